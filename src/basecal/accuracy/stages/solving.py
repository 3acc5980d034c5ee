"""Stages that solve: with the noise as stated, with estimated noise, without outliers, with likely lenses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.findings.better_optimum import guess_finding
from basecal.accuracy.findings.outlier_samples import agreement_findings
from basecal.accuracy.findings.unobservable_direction import unobservable_by_poses
from basecal.accuracy.input_check.conventions import check_conventions
from basecal.accuracy.input_check.unexplained_motion import hopeless_finding, is_hopeless, joint_offset_findings
from basecal.accuracy.phrases.changed_frame import changed_frame
from basecal.accuracy.stages.case import Case
from basecal.cell import Finding
from basecal.estimation.outliers.likely_lenses import with_likely_lenses
from basecal.estimation.outliers.noise_and_outliers import has_plausible_noise, solve_with_noise, with_noise
from basecal.estimation.outliers.robust_solve import solve_robustly
from basecal.estimation.solve import Solution, integrate_solution, solve_problem


def solve_all(case: Case) -> Case:
    """Solve for all samples, with the noise as stated and with unstated noise estimated.

    Guesses are ignored if they lead to an answer that does not explain the views, and the closed form to a better one.
    """
    plain = solve_problem(case.problem, case.cell, case.stated_settings)
    if case.settings.start == "guess" and is_hopeless(plain.problem, plain.state):
        unguessed = replace(case, settings=replace(case.settings, start="closed"))
        other = solve_problem(case.problem, case.cell, unguessed.stated_settings)
        if other.cost < plain.cost:
            case, plain = unguessed.with_findings([guess_finding()]), other
    noisy = None if case.settings.robot_noise == "stated" else with_noise(plain, case.settings)
    return replace(case, plain=plain, noisy=noisy)


def screen_conventions(case: Case) -> Case:
    """Refuse input that another convention explains better."""
    explained = case.noisy is not None and has_plausible_noise(case.noisy)
    misread = check_conventions(
        case.cell, case.recording, case.problem, case.solution, case.stated_settings, is_explained=explained
    )
    found = case.with_findings(misread)
    return found.refuse() if any(each.severity == "error" for each in misread) else found


def leave_outliers_out(case: Case) -> Case:
    """Solve without outliers; robots are assumed exact if no plausible robot noise explains the views."""
    assert case.plain is not None
    noisy = case.noisy
    if noisy is not None and has_plausible_noise(noisy):
        return replace(case, robust=solve_with_noise(case.cell, case.settings, case.plain, noisy))
    with case.settings.stage("outliers"):
        exact = solve_robustly(case.plain.problem, case.cell, case.stated_settings, case.plain)
    if noisy is None or not _has_open_noise(noisy) or is_hopeless(exact.solution.problem, exact.solution.state):
        return replace(case, robust=exact)
    try:
        robust = solve_with_noise(case.cell, case.settings, case.plain, noisy, exact)
    except np.linalg.LinAlgError:  # with robot noise the unknowns diverge: it explains nothing
        robust = exact
    return replace(case, robust=robust)


def _has_open_noise(solution: Solution) -> bool:
    noise = solution.noise
    return bool(noise.estimated or noise.robots or noise.jitter_s)


def widen_lenses(case: Case) -> Case:
    """Estimate stated lenses with priors as wide as the data suggest."""
    assert case.robust is not None
    return replace(case, robust=with_likely_lenses(case.robust, case.cell, case.settings))


def join_static_scene(case: Case) -> Case:
    """Add the static scene to the solution, if it is requested or tracks of it were recorded."""
    has_tracks = any(each.tracks for each in case.recording.samples)
    if not (case.settings.joins_scene or has_tracks) or not case.solution.converged:
        return case
    from basecal.accuracy.scene.checks import drop_target_findings
    from basecal.accuracy.scene.join_scene import join_scene  # reads images, which most calibrations do not need

    assert case.robust is not None
    outliers = set(case.robust.left_out.samples.tolist())
    joined, findings, scene = join_scene(case.cell, case.recording, case.solution, case.settings, outliers)
    found = case.findings if scene is None else drop_target_findings(case.findings)
    return replace(case, robust=replace(case.robust, solution=joined), scene=scene, findings=(*found, *findings))


def integrate_noise(case: Case) -> Case:
    """Integrate the covariance over the distribution of unstated sigmas."""
    assert case.robust is not None
    return replace(case, robust=replace(case.robust, solution=integrate_solution(case.solution)))


def is_explained(case: Case) -> bool:
    """Whether the solution explains the motion of the targets."""
    return case.is_ended or not is_hopeless(case.solution.problem, case.solution.state)


def refuse_unexplained_poses(case: Case) -> Case:
    """Refuse poses that do not explain the views, because of unobservable directions or because they are wrong."""
    if is_explained(case):
        return case
    last = case.solution
    causes = (
        unobservable_by_poses(case.cell, case.problem)
        or joint_offset_findings(last.problem, last.state, case.stated_settings)
        or _disagreement(case)
    )
    return case.refuse([*causes, *(finding for finding in case.findings if finding.code != causes[0].code)])


def _disagreement(case: Case) -> list[Finding]:
    """Errors that a frame changed between earlier and later samples, or that poses and views do not agree."""
    assert case.robust is not None
    changed, last = changed_frame(case.problem, case.cell), case.solution
    agreement = agreement_findings(case.robust, changed)
    if changed is not None:
        return [replace(each, severity="error") for each in agreement]
    return [hopeless_finding(last.problem, last.state), *agreement]
