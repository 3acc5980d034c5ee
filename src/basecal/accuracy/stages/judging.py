"""Stages that judge a solution by its residuals, by alternative models and by held-out samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.clocks.correction import apply_remaining_step, remaining_step
from basecal.accuracy.covariance.widening import largest_shift, widen
from basecal.accuracy.cross_validation.closed_form_rival import ClosedFormRival
from basecal.accuracy.cross_validation.robot_model_selection import choose_robot_model
from basecal.accuracy.cross_validation.station_scores import place_errors
from basecal.accuracy.cross_validation.validation import cross_validate
from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.findings.registry import ANSWER_CHECKS
from basecal.accuracy.findings.systematic_error import deduplicate_size_findings
from basecal.accuracy.lens_structure import LensStructure, lens_structures
from basecal.accuracy.stages.case import Case
from basecal.accuracy.stated_sigmas import contradicted_sigmas, unlikely_sigmas, without_contradicted_sigmas
from basecal.accuracy.systematic_errors.expected_sizes import contain_expected_sizes
from basecal.accuracy.systematic_errors.pose_fields import stated_fields
from basecal.accuracy.systematic_errors.search import systematic_error
from basecal.accuracy.systematic_errors.situation import situate
from basecal.cell import Certificate
from basecal.effects import fixed_transform
from basecal.effects.faces.effect import FoundEffect
from basecal.effects.registry import BY_PLACE, CONTAINED
from basecal.estimation.certificate.certificate import certify
from basecal.estimation.noise.joint_estimate import MANY_VIEWS
from basecal.estimation.noise.robot_noise import some_views
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_at_mode, solve_from
from basecal.geometry import Array


def screen_stated_sigmas(case: Case) -> Case:
    """Estimate stated sigmas that the residuals contradict."""
    assert case.robust is not None
    contradicted = contradicted_sigmas(case.solution) or unlikely_sigmas(case.solution, case.settings)
    robust = without_contradicted_sigmas(case.robust, contradicted, case.settings)
    refuted = case.solution if any(each.is_too_small for each in contradicted) else None
    evidence = Evidence(
        case.cell,
        case.settings,
        case.problem,
        robust,
        robust.solution,
        contradicted_sigmas=contradicted,
        refuted=refuted,
        units_m=case.units_m,
        images=case.recording.image_paths(),
    )
    return replace(case, robust=robust, gathered_evidence=evidence)


def choose_kinematics(case: Case) -> Case:
    """Choose the kinematic model of each robot by its prediction of held-out samples."""
    return case.with_evidence(robot_model=choose_robot_model(case.solution, case.stated_settings))


def find_systematic_error(case: Case) -> Case:
    """Search for a systematic error that explains the residuals better than noise."""
    found = systematic_error(case.solution, case.problem, case.recording.stamps, case.settings, case.evidence.refuted)
    return case.with_evidence(systematic_error=found)


def certify_solution(case: Case) -> Case:
    """Prove that no other optimum is better, or switch to a better one."""
    solution, certificate = prove_solution(case.solution, case.stated_settings)
    return replace(case.with_evidence(solution=solution), certificate=certificate)


def predict_held_out_samples(case: Case) -> Case:
    """Predict held-out samples, and test whether the lens models are sufficient."""
    solution = case.evidence.solution
    validated = cross_validate(
        thin_solution(solution, case.stated_settings), case.cell.requested_transforms, case.stated_settings
    )
    return case.with_evidence(
        cross_validation=validated,
        lens_structures=lens_structures(solution, case.settings),
        held_out_places=place_errors(solution, case.settings.iterations),
    )


def list_findings(case: Case) -> Case:
    """Add the findings that the evidence supports."""
    found = (finding for check in ANSWER_CHECKS for finding in check(case.evidence))
    findings = deduplicate_size_findings(case.cell, [*case.findings, *found], case.evidence.systematic_error)
    first = {(each.code, each.about): each for each in reversed(findings) if each.code == fixed_transform.CODE}
    # An error that both tests report is listed once.
    kept = (each for each in findings if first.get((each.code, each.about), each) is each)
    return replace(case, findings=tuple(kept))


def cover_effects(case: Case) -> Case:
    """Shift the answer by contained effects, and widen its covariance by all systematic effects."""
    evidence = case.evidence
    fitted = solution = evidence.solution
    rival = None if evidence.cross_validation is None else evidence.cross_validation.rival
    robots_with_fields = _robots_with_fields(case)
    for other in (evidence.systematic_error, rival, *evidence.lens_structures):
        solution = solution if other is None else widen(solution, _effect_shift(solution, other, robots_with_fields))
    remaining = None if case.clocked is None else remaining_step(case.clocked, fitted)
    offsets = None if remaining is None else remaining.offsets
    contained = contain_expected_sizes(case.cell, solution, evidence.systematic_error, offsets)
    if remaining is None:
        return replace(case, answers=(fitted, contained.solution, contained.solution))
    clocked = apply_remaining_step(contained.solution, remaining)
    step = remaining.add_effects(contained.shift_s, contained.offset_covariance)
    return replace(case, answers=(fitted, contained.solution, clocked), clock_step=step)


def _robots_with_fields(case: Case) -> frozenset[str]:
    """Robots whose stated error fields already cover the systematic error; empty if that error is certain."""
    error = case.evidence.systematic_error
    if error is None or error.is_certain:
        return frozenset()
    return frozenset(field.robot for field in stated_fields(case.cell, situate(case.evidence.solution)))


def _effect_shift(
    solution: Solution, effect: FoundEffect | ClosedFormRival | LensStructure, covered_robots: frozenset[str]
) -> Array:
    """Shift of the answer by an effect, (p,); of confounded effects the largest shift.

    Args:
        solution: The answer.
        effect: The effect.
        covered_robots: Robots whose error fields already cover position-dependent effects.
    """
    if isinstance(effect, FoundEffect):
        others = (each for each in (effect, *effect.alternatives) if each.effect not in CONTAINED)
        excluded = [each.moved for each in others if each.effect not in BY_PLACE or each.about not in covered_robots]
        return np.asarray(effect.probability**0.5 * largest_shift(solution, excluded or [np.zeros_like(effect.moved)]))
    return effect.moved


# Switches to a better optimum, each of which lowers the cost; `benchmarks.certificate` judges it.
_CERTIFICATE_ROUNDS = 3


def prove_solution(solution: Solution, settings: Settings) -> tuple[Solution, Certificate | None]:
    """The best solution found and its certificate; the given solution if the proof finds no better one.

    A certificate is computed if the settings request it, or if starts converged to different optima; else it is None.
    """
    if not (settings.certify or solution.disputed):
        return solution, None
    best, found = solution, certify(solution)
    for _ in range(_CERTIFICATE_ROUNDS):
        if found.better is None:
            break
        best = replace(solve_from(best.problem, found.better, settings, best.findings), disputed=best.disputed)
        found = certify(best)
    return best, found.certificate


def thin_solution(solution: Solution, settings: Settings) -> Solution:
    """Solution from at most 2,000 views of each camera and target, spread evenly, with the sigmas from all views.

    The given solution if it has no more views, or if the solve for the fewer views does not converge.
    """
    if max(map(len, solution.problem.groups), default=0) <= MANY_VIEWS:
        return solution
    problem, state = some_views(solution.problem, solution.state, MANY_VIEWS)
    found = solve_at_mode(replace(problem, held=True), state, settings)
    if not found.converged:
        return solution
    return replace(found, noise=solution.noise, covariance=solution.noise.factor * found.covariance)
