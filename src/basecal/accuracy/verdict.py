"""Calibrate: solve, and all that makes the answer worth trusting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from basecal.accuracy.by_shifts import calibrate_by_shifts
from basecal.accuracy.fit import residuals
from basecal.accuracy.kinematics import deflection, held_findings, joint_offsets, link_parameters
from basecal.accuracy.loops import closed_loops
from basecal.accuracy.robot_model import choose_robot_model, robot_model_findings
from basecal.cell import Calibration, Cell, Finding, Recording, Residuals
from basecal.cell.calibration import Severity, Verdict
from basecal.estimation.noise import CONTRADICTED
from basecal.estimation.packing import pack
from basecal.estimation.problem import Problem
from basecal.estimation.settings import DEFAULT, Settings
from basecal.estimation.solve import Solution, solve_packed
from basecal.geometry import IntArray

_MANY_DROPPED = 0.1
_POOR_FIT_PX = 3.0
_OUTLIER_SIGMAS = 6.0
_SHOWN = 10


def calibrate(cell: Cell, recording: Recording, settings: Settings = DEFAULT) -> Calibration:
    """The transforms of a cell with covariance, and whether to trust them.

    Args:
        cell: What exists and what is known.
        recording: What was seen.
        settings: How to solve.

    Returns:
        The calibration; with verdict `refused` and findings that say why where the data fall short of an answer.

    Raises:
        InputError: if the cell contradicts the recording.
        NotObservable: if the axis-shift method is asked for and the recording has no station, or a mount is not known.
    """
    problem, dropped = pack(cell, recording)
    findings = [*recording.findings, *dropped]
    findings += _too_many_dropped(problem, findings)
    too_few = _too_few(problem)
    if too_few is not None:
        return _refused(settings, [*findings, too_few])
    if settings.method == "axis-shift":
        return calibrate_by_shifts(cell, problem, settings, findings)
    solution = solve_packed(problem, cell, settings)
    fit = replace(residuals(solution), loops=closed_loops(solution))
    findings += _unseen(cell, solution) + _not_converged(solution)
    findings += robot_model_findings(choose_robot_model(solution, settings))
    findings += _poor_fit(solution, fit) + _outliers(solution)
    findings += held_findings(cell, solution)
    return _calibration(cell, solution, fit, settings, findings)


def verdict_of(findings: Sequence[Finding]) -> Verdict:
    """`refused` with an error among the findings, `doubtful` with a warning, else `good`."""
    severities = {f.severity for f in findings}
    return "refused" if "error" in severities else "doubtful" if "warning" in severities else "good"


def _refused(settings: Settings, findings: list[Finding]) -> Calibration:
    return Calibration("refused", findings=tuple(findings), settings=settings.as_dict())


def _samples(problem: Problem) -> set[int]:
    return {int(number) for group in problem.groups for number in group.sample}


def _too_few(problem: Problem) -> Finding | None:
    """A refusal where no view can be checked: without the largest, equations are fewer than unknowns."""
    count = len(_samples(problem))
    if count < 2:
        found = "no sample shows" if count == 0 else "a single sample shows"
        return _too_few_finding(f"{found} a target to a camera with every robot's pose")
    equations = np.concatenate([g.measurement.equations() for g in problem.groups])
    free = sum(w.stop - w.start for n, w in problem.columns.items() if n in problem.unknowns and _is_free(problem, n))
    models = problem.models.values()
    free += sum(width for m in models for name, width in m.widths.items() if m.sigmas[name] is None)
    if equations.sum() - equations.max() >= free:
        return None
    return _too_few_finding(
        f"{count} samples give {int(equations.sum())} equations for {free} unknowns: none is left to check them"
    )


def _is_free(problem: Problem, name: str) -> bool:
    return problem.unknowns[name].status == "free"


def _too_few_finding(what: str) -> Finding:
    advice = "record at least 10 samples with every arm in different orientations (20 for a single light)"
    return Finding("too-few-samples", "error", (), f"{what}: {advice}")


def _too_many_dropped(problem: Problem, findings: list[Finding]) -> list[Finding]:
    about = {name for f in findings if f.code == "dropped-sample" for name in f.about}
    dropped = {name for name in about if name.isdecimal()}
    total = len(_samples(problem)) + len(dropped)
    if len(dropped) <= _MANY_DROPPED * total:
        return []
    message = f"{len(dropped)} of {total} samples could not be used; see the other findings for the reasons"
    return [Finding("dropped-sample", "warning", (), message)]


def _unseen(cell: Cell, solution: Solution) -> list[Finding]:
    if not solution.seen.unseen:
        return []
    blind_asked = [name for name in cell.asked if name in solution.seen.blind]
    severity: Severity = "error" if blind_asked else "warning"
    about = tuple(sorted(solution.seen.blind))
    return [
        Finding(
            "unseen-direction",
            severity,
            about,
            f"the data do not see {words}: add samples that turn every arm about two axes that are not parallel, "
            "or state a prior or the value of what is known",
        )
        for words in solution.seen.unseen
    ]


def _not_converged(solution: Solution) -> list[Finding]:
    if solution.converged:
        return []
    message = "the iteration ended away from an optimum: check units and directions of the poses, or give a guess"
    return [Finding("not-converged", "error", (), message)]


def _poor_fit(solution: Solution, fit: Residuals) -> list[Finding]:
    ratio = float(np.sqrt(solution.cost / max(solution.dof, 1)))
    if not solution.noise.estimated and ratio > CONTRADICTED:
        message = f"residuals are {ratio:.1f} times what the stated sigmas explain; sigmas are scaled up by as much"
    elif "pixel_px" in solution.noise.estimated and fit.rms_px is not None and fit.rms_px > _POOR_FIT_PX:
        message = (
            f"residuals of {fit.rms_px:.1f} px are more than any detector's noise: something in the input is wrong"
        )
    else:
        return []
    advice = "check units, directions and the target's size, and state the robots' noise where it is not"
    return [Finding("poor-fit", "warning", (), f"{message}: {advice}")]


def _outliers(solution: Solution) -> list[Finding]:
    """Stops whose pose error is more than six sigma in a direction: a chance of 2e-9 each where the noise is true."""
    errors = np.abs(solution.state.stop_errors).max(axis=-1, initial=0.0)
    far = np.flatnonzero(errors > _OUTLIER_SIGMAS)
    samples = sorted(_samples_at(solution.problem, far))
    if not samples:
        return []
    shown = ", ".join(map(str, samples[:_SHOWN])) + (", ..." if len(samples) > _SHOWN else "")
    message = (
        f"a robot was off by up to {errors.max():.0f} of its stated sigmas at sample {shown}: taken before the arm "
        "settled, or bumped; leave these samples out, or state a larger noise"
    )
    return [Finding("outlier-samples", "warning", tuple(map(str, samples)), message)]


def _samples_at(problem: Problem, stops: IntArray) -> set[int]:
    """Numbers of the samples that stand in these stops."""
    return {
        int(number)
        for group in problem.groups
        for stop in (group.eye_stop, group.hand_stop)
        for number in group.sample[np.isin(stop, stops)]
    }


def _calibration(
    cell: Cell, solution: Solution, fit: Residuals, settings: Settings, findings: list[Finding]
) -> Calibration:
    kept = solution.transforms if solution.converged else {}
    estimates = {n: e for n, e in kept.items() if n not in solution.seen.blind}
    order = tuple(n for n in estimates if solution.problem.unknowns[n].status != "fixed")
    return Calibration(
        verdict=verdict_of(findings),
        transforms=estimates,
        status={n: solution.problem.unknowns[n].status for n in estimates},
        points=frozenset(n for n in solution.problem.point_mounts if n in estimates),
        cameras={n: (c, solution.lens_covariance(n)) for n, c in _estimated_lenses(solution)},
        joint_offsets=joint_offsets(solution) if solution.converged else {},
        link_parameters=link_parameters(solution) if solution.converged else {},
        deflection=deflection(solution) if solution.converged else {},
        noise=_noise(cell, solution),
        order=order,
        joint_covariance=solution.covariance_of(list(order)),
        residuals=fit,
        condition=solution.seen.condition if np.isfinite(solution.seen.condition) else None,
        unseen=solution.seen.unseen,
        findings=tuple(findings),
        settings=settings.as_dict(),
    )


def _estimated_lenses(solution: Solution) -> list[tuple[str, Any]]:
    return [
        (n, c)
        for n, c in solution.state.cameras.items()
        if n in solution.problem.columns and n not in solution.seen.blind
    ]


def _noise(cell: Cell, solution: Solution) -> dict[str, Any]:
    used: dict[str, Any] = {field: getattr(solution.noise.noise, field) for field in solution.noise.estimated}
    if cell.pixel_px is not None and "pixel_px" not in used:
        used["pixel_px"] = cell.pixel_px
    used["robots"] = {
        name: {"sigma_t_m": robot.noise[:3].tolist(), "sigma_r_rad": robot.noise[3:].tolist()}
        for name, robot in cell.robots.items()
        if robot.noise is not None
    }
    return used
