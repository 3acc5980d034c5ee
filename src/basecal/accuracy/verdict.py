"""Calibrate: solve, and all that makes the answer worth trusting."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from basecal.accuracy.at_the_door.repeated_views import repeated_views
from basecal.accuracy.at_the_door.units import impossible_units
from basecal.accuracy.axis_shift import calibrate_axis_shift
from basecal.accuracy.certify import certified
from basecal.accuracy.clocks.search import Clocked, clocked
from basecal.accuracy.clocks.settle import clock_findings, clock_offsets, clocks_left, line_times, settled
from basecal.accuracy.cross_validation.closed_form_rival import ClosedFormRival
from basecal.accuracy.cross_validation.robot_model_selection import RobotModelChoice, choose_robot_model
from basecal.accuracy.cross_validation.some_views import of_some_views
from basecal.accuracy.cross_validation.validation import cross_validate
from basecal.accuracy.findings.better_optimum import guess_led_astray
from basecal.accuracy.findings.evidence import Evidence, Input
from basecal.accuracy.findings.outlier_samples import agreeing_of
from basecal.accuracy.findings.registry import ANSWER_CHECKS, INPUT_CHECKS
from basecal.accuracy.findings.unobservable_direction import unobservable_by_poses
from basecal.accuracy.input_check.conventions import check_conventions
from basecal.accuracy.input_check.unexplained_motion import hopeless, is_hopeless
from basecal.accuracy.lens_structure import LensStructure, lens_structures
from basecal.accuracy.noise_summary import noise_summary
from basecal.accuracy.phrases.null_space import describe_null_space
from basecal.accuracy.phrases.outlier import described_outlier
from basecal.accuracy.residuals.fit import residuals
from basecal.accuracy.robot_parameters import robot_parameters
from basecal.accuracy.stated_sigmas import ContradictedSigma, contradicted_sigmas, without_contradicted
from basecal.accuracy.systematic_errors.search import systematic_error
from basecal.accuracy.systematic_errors.sizes_once import sizes_once
from basecal.accuracy.systematic_errors.stated_sizes import moved_by_sizes
from basecal.accuracy.task.at_task import at_task
from basecal.accuracy.task.task import placing
from basecal.accuracy.transform_verdicts import transform_verdicts
from basecal.accuracy.widening import largest, widened
from basecal.cell import Calibration, Cell, Finding, Recording, Residuals
from basecal.cell.calibration import Verdict
from basecal.effects.faces.found import FoundEffect
from basecal.estimation.outliers.likely_lenses import with_likely_lenses
from basecal.estimation.outliers.noise_and_outliers import is_as_of_arms, solve_with_noise, with_noise
from basecal.estimation.outliers.robust_solve import RobustSolution, solve_robustly
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem
from basecal.estimation.settings import DEFAULT, LOG, Settings
from basecal.estimation.solve import Solution, solve_packed
from basecal.estimation.streams.streams import streams_of
from basecal.geometry import Array

_LEVELS = {"error": logging.ERROR, "warning": logging.WARNING, "info": logging.INFO}


def calibrate(cell: Cell, recording: Recording, settings: Settings = DEFAULT) -> Calibration:
    """The transforms of a cell with covariance, and whether to trust them.

    Args:
        cell: What exists and what is known.
        recording: What was seen.
        settings: How to solve.

    Returns:
        The calibration; with verdict `refused` and findings that say why where the data fall short of an answer.

    Raises:
        InputError: if the cell contradicts the recording, or a task point is named and nothing is placed for it.
        NotObservable: if the axis-shift method is asked for and the recording has no station, or a mount is not known.
    """
    if settings.task_point is not None and settings.method != "axis-shift":
        placing(cell)
    with settings.stage("clocks"):
        streams = streams_of(cell, recording)
        by_clocks = None if streams is None else clocked(streams, settings)
    samples = recording if by_clocks is None else by_clocks.recording
    calibration = _calibrated(cell, samples, settings, by_clocks)
    LOG.info("verdict: %s", calibration.verdict)
    for finding in calibration.findings:
        LOG.log(_LEVELS[finding.severity], "%s: %s", finding.code, finding.message)
    return calibration


def _calibrated(cell: Cell, recording: Recording, settings: Settings, by_clocks: Clocked | None) -> Calibration:
    """The calibration of samples, made by clocks that were estimated or not."""
    if units := impossible_units(cell, recording):
        return Calibration("refused", findings=(*units, *recording.findings), settings=settings.as_dict())
    with settings.stage("problem"):
        problem, dropped = build_problem(cell, recording)
        problem = problem if by_clocks is None else by_clocks.shaken(problem)
    read = (*recording.findings, *repeated_views(cell, recording), *dropped)
    given = Input(problem, read, on_paths=by_clocks is not None)
    findings = [*given.findings, *(finding for check in INPUT_CHECKS for finding in check(given))]
    if verdict_of(findings) == "refused":
        return Calibration("refused", findings=tuple(findings), settings=settings.as_dict())
    if settings.method == "axis-shift":
        return calibrate_axis_shift(cell, problem, settings, findings)
    stated = replace(settings, robot_noise="stated")
    plain = solve_packed(problem, cell, stated)
    noisy = None if settings.robot_noise == "stated" else with_noise(plain, settings)
    with settings.stage("conventions"):
        explained = noisy is not None and is_as_of_arms(noisy)
        misread = check_conventions(cell, recording, problem, plain, stated, explained)
    findings += misread
    if verdict_of(misread) == "refused":
        return _refused(plain, settings, findings)
    robust = with_likely_lenses(_without_outliers(cell, settings, plain, noisy), cell, settings)
    if is_hopeless(robust.solution.problem, robust.solution.state):
        if settings.start == "guess":
            again = _calibrated(cell, recording, replace(settings, start="closed"), by_clocks)
            return replace(again, findings=(*again.findings, guess_led_astray()))
        return _refused(robust.solution, settings, _why_hopeless(cell, problem, robust, findings))
    with settings.stage("stated sigmas"):
        as_stated = robust.solution
        contradicted = contradicted_sigmas(as_stated)
        robust = without_contradicted(robust, contradicted, settings)
    with settings.stage("robot model"):
        model = choose_robot_model(robust.solution, stated)
    with settings.stage("systematic errors"):
        stamps = {s.sample: s.stamp_s for s in recording.samples if s.stamp_s is not None}
        refuted = as_stated if any(each.too_small for each in contradicted) else None
        found = systematic_error(robust.solution, problem, stamps, settings, refuted)
    return _judged(cell, recording, problem, robust, contradicted, found, model, settings, findings, by_clocks)


def _why_hopeless(cell: Cell, problem: Problem, robust: RobustSolution, findings: list[Finding]) -> list[Finding]:
    """What the recorded poses hide, which leads a solver astray, or else that they do not belong to the views."""
    last = robust.solution
    why = unobservable_by_poses(cell, problem) or [hopeless(last.problem, last.state), *agreeing_of(robust)]
    return [*why, *(finding for finding in findings if finding.code != why[0].code)]


def _without_outliers(cell: Cell, settings: Settings, plain: Solution, noisy: Solution | None) -> RobustSolution:
    """The solution of what agrees; with robots taken for exact where no noise of arms explains the views."""
    if noisy is not None and is_as_of_arms(noisy):
        return solve_with_noise(cell, settings, plain, noisy)
    with settings.stage("outliers"):
        exact = solve_robustly(plain.problem, cell, replace(settings, robot_noise="stated"), plain)
    nothing_open = noisy is None or not (noisy.noise.estimated or noisy.noise.robots or noisy.noise.jitter_s)
    if noisy is None or nothing_open or is_hopeless(exact.solution.problem, exact.solution.state):
        return exact
    return solve_with_noise(cell, settings, plain, noisy, exact)


def _judged(
    cell: Cell,
    recording: Recording,
    recorded: Problem,
    robust: RobustSolution,
    contradicted: tuple[ContradictedSigma, ...],
    systematic: FoundEffect | None,
    model: RobotModelChoice | None,
    settings: Settings,
    findings: list[Finding],
    by_clocks: Clocked | None,
) -> Calibration:
    """The answer with everything that is found about it."""
    stated = replace(settings, robot_noise="stated")
    with settings.stage("certificate"):
        solution, certificate = certified(robust.solution, stated)
    with settings.stage("residuals"):
        fit = residuals(solution, robust.left_out)
    with settings.stage("cross-validation"):
        validated = cross_validate(of_some_views(solution, stated), cell.asked, stated)
        lenses = lens_structures(solution, settings)
    judged = (solution, fit, validated, model, contradicted, systematic, lenses)
    evidence = Evidence(cell, settings, recorded, robust, *judged)
    fitted = solution
    with settings.stage("findings"):
        findings = sizes_once(cell, [*findings, *(f for check in ANSWER_CHECKS for f in check(evidence))], systematic)
    rival = None if validated is None else validated.rival
    for other in (systematic, rival, *lenses):
        solution = solution if other is None else widened(solution, _moved_by(solution, other))
    for moved in moved_by_sizes(cell, fitted, systematic):
        solution = widened(solution, moved)
    as_modelled = solution
    solution, clocks = _by_clocks(solution, robust, by_clocks, findings)
    calibration = _calibration(cell, recording, solution, fit, settings, findings)
    with settings.stage("task"):
        calibration = at_task(cell, calibration, settings, (fitted, as_modelled, solution))
    return replace(
        calibration,
        **clocks,
        outliers=tuple(map(described_outlier, robust.outliers)),
        validation=None if validated is None else validated.summary,
        certificate=certificate,
    )


def _moved_by(solution: Solution, other: FoundEffect | ClosedFormRival | LensStructure) -> Array:
    """By how much something that noise is not moves the answer, (p,); of effects alike the one that moves it most."""
    if isinstance(other, FoundEffect):
        return largest(solution, [each.moved for each in (other, *other.alternatives)])
    return other.moved


def _by_clocks(
    solution: Solution, robust: RobustSolution, by_clocks: Clocked | None, findings: list[Finding]
) -> tuple[Solution, dict[str, Any]]:
    """The solution with what is left of the clocks, and what is told of them; the rest joins the findings."""
    if by_clocks is None:
        return solution, {}
    left = clocks_left(by_clocks, robust.solution)
    findings += clock_findings(by_clocks, left)
    told = {"clocks": clock_offsets(by_clocks, left), "line_times": line_times(by_clocks, left)}
    return settled(solution, left), told


def verdict_of(findings: Sequence[Finding]) -> Verdict:
    """`refused` with an error among the findings, `doubtful` with a warning, else `good`."""
    severities = {f.severity for f in findings}
    return "refused" if "error" in severities else "doubtful" if "warning" in severities else "good"


def _refused(solution: Solution, settings: Settings, findings: list[Finding]) -> Calibration:
    """How the input fits as it is read, and no numbers: they would be of a cell that does not exist."""
    return Calibration("refused", residuals=residuals(solution), findings=tuple(findings), settings=settings.as_dict())


def _calibration(
    cell: Cell, recording: Recording, solution: Solution, fit: Residuals, settings: Settings, findings: list[Finding]
) -> Calibration:
    found = solution.transforms if solution.converged else {}
    estimates = {n: e for n, e in found.items() if n not in solution.observability.unobservable}
    lenses = solution.problem.columns.keys() - solution.observability.unobservable if solution.converged else set()
    order = tuple(n for n in estimates if solution.problem.unknowns[n].status != "fixed")
    return Calibration(
        verdict=verdict_of(findings),
        transforms=estimates,
        verdicts=transform_verdicts(solution.problem, estimates, findings),
        status={n: solution.problem.unknowns[n].status for n in estimates},
        points=frozenset(n for n in solution.problem.point_mounts if n in estimates),
        cameras={n: (c, solution.lens_covariance(n)) for n, c in solution.state.cameras.items() if n in lenses},
        robot_parameters=robot_parameters(solution) if solution.converged else {},
        noise=noise_summary(cell, recording, solution),
        order=order,
        joint_covariance=solution.covariance_of(list(order)) if order else None,
        residuals=fit,
        condition=solution.observability.condition if np.isfinite(solution.observability.condition) else None,
        unobservable=tuple(map(describe_null_space, solution.observability.null_space)),
        findings=tuple(findings),
        settings=settings.as_dict(),
    )
