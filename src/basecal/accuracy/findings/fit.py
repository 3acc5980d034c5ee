"""What the numbers of views and the size of the residuals say by themselves, as findings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.accuracy.findings.observability import motion_findings
from basecal.cell import Finding, Residuals
from basecal.estimation.noise.estimate import CONTRADICTED
from basecal.estimation.noise.robot_noise import stops_made
from basecal.estimation.problem.problem import Problem
from basecal.estimation.solve import Solution

_MANY_DROPPED = 0.1
_POOR_FIT_PX = 3.0
_POOR_ARM_M = 3e-3
_POOR_ARM_RAD = 1e-2
_FEWEST_STOPS = 12


def too_few(problem: Problem) -> Finding | None:
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
    found = f"{count} samples give {int(equations.sum())} equations for {free} unknowns: none is left to check them"
    return _too_few_finding(found, motion_findings(problem))


def _samples(problem: Problem) -> set[int]:
    return {int(number) for group in problem.groups for number in group.sample}


def _is_free(problem: Problem, name: str) -> bool:
    return problem.unknowns[name].status == "free"


def _too_few_finding(what: str, moved: str = "") -> Finding:
    advice = "record at least 10 samples with every arm in different orientations (20 for a single light)"
    return Finding("too-few-samples", "error", (), f"{what}: {advice}{f'; so far {moved}' if moved else ''}")


def many_dropped(problem: Problem, findings: Sequence[Finding]) -> list[Finding]:
    """A warning where more than a tenth of the samples could not be used, by the findings so far."""
    about = {name for f in findings if f.code == "dropped-sample" for name in f.about}
    dropped = {name for name in about if name.isdecimal()}
    total = len(_samples(problem)) + len(dropped)
    if len(dropped) <= _MANY_DROPPED * total:
        return []
    message = f"{len(dropped)} of {total} samples could not be used; see the other findings for the reasons"
    return [Finding("dropped-sample", "warning", (), message)]


def few_stops(problem: Problem) -> list[Finding]:
    """What is told of robots that state no noise and made too few stops to estimate it; nothing where all made more.

    From 15 boards estimated sigmas scatter by a quarter, see `benchmarks.consistency`; from fewer they hardly count.
    """
    few = {name: stops_made(problem, name) for name in sorted(problem.unstated)}
    few = {name: count for name, count in few.items() if 1 < count < _FEWEST_STOPS}
    if not few:
        return []
    made = " and ".join(f"{name} made {count} stops" for name, count in few.items())
    message = (
        f"{made}, too few to estimate noise that is not stated: the robots are taken for exact; state their noise, "
        f"record at least {_FEWEST_STOPS} stops, or estimate it all the same (`--robot-noise estimated`)"
    )
    return [Finding("noise-not-identifiable", "info", tuple(few), message)]


def not_converged(solution: Solution) -> list[Finding]:
    """An error where the solver ended away from an optimum."""
    if solution.converged:
        return []
    message = "the iteration ended away from an optimum: check units and directions of the poses, or give a guess"
    return [Finding("not-converged", "error", (), message)]


def poor_fit(solution: Solution, fit: Residuals) -> list[Finding]:
    """A warning where residuals are larger than the stated sigmas explain, or any detector's or arm's noise."""
    ratio = float(np.sqrt(solution.cost / max(solution.dof, 1)))
    if not solution.noise.estimated and ratio > CONTRADICTED:
        message = f"residuals are {ratio:.1f} times what the stated sigmas explain; sigmas are scaled up by as much"
    elif "pixel_px" in solution.noise.estimated and fit.rms_px is not None and fit.rms_px > _POOR_FIT_PX:
        message = (
            f"residuals of {fit.rms_px:.1f} px are more than any detector's noise: something in the input is wrong"
        )
    elif (worst := _beyond_an_arm(solution)) is not None:
        message = (
            f"residuals ask for errors of the robots' poses of {1e3 * worst[0]:.1f} mm and "
            f"{np.degrees(worst[1]):.2f} deg per axis, more than any arm's repeatability"
        )
    else:
        return []
    advice = "check units, directions and the target's size, and state the robots' noise where it is not"
    return [Finding("poor-fit", "warning", (), f"{message}: {advice}")]


def _beyond_an_arm(solution: Solution) -> tuple[float, float] | None:
    """The largest estimated sigmas of robots [m, rad], where no arm in order is as bad as that."""
    sigmas = np.array(list(solution.noise.robots.values())).reshape(-1, 6)
    worst_m, worst_rad = sigmas[:, :3].max(initial=0.0), sigmas[:, 3:].max(initial=0.0)
    return (worst_m, worst_rad) if worst_m > _POOR_ARM_M or worst_rad > _POOR_ARM_RAD else None
