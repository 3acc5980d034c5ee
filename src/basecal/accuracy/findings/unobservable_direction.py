"""`unobservable-direction`: translations and rotations that the data leave open, and the motions that hide them."""

from __future__ import annotations

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.phrases.null_space import describe_direction, describe_twists, is_unobservable
from basecal.accuracy.phrases.robot_motion import advise_motion, describe_cause, describe_motion
from basecal.accuracy.phrases.touch_advice import touch_advice
from basecal.cell import Cell, Finding
from basecal.cell.calibration import Severity
from basecal.errors import sentence
from basecal.estimation.observability.motions import gauge_partners, motions
from basecal.estimation.problem.problem import Problem


def unobservable_directions(evidence: Evidence) -> list[Finding]:
    """A finding for each null space: by the solution, or where there is none by the recorded poses alone."""
    by_poses = [] if evidence.solution.converged else unobservable_by_poses(evidence.cell, evidence.solution.problem)
    if by_poses:
        return by_poses
    problem, observability = evidence.solution.problem, evidence.solution.observability
    severity: Severity = (
        "error" if observability.unobservable.intersection(evidence.cell.requested_transforms) else "warning"
    )
    moved = motions(problem) if observability.null_space else {}
    together: dict[tuple[str, ...], list[str]] = {}
    advice: dict[tuple[str, ...], tuple[tuple[str, ...], str] | None] = {}
    for direction in observability.null_space:
        together.setdefault(direction.names, []).append(describe_direction(direction))
        advice.setdefault(direction.names, touch_advice(evidence.cell, problem, evidence.solution.state, direction))
    return [
        Finding(
            "unobservable-direction",
            severity,
            names,
            sentence(is_unobservable(whats, names[1:])),
            *(advice[names] or describe_cause(evidence.cell, problem, moved, names)),
        )
        for names, whats in together.items()
    ]


def unobservable_by_poses(cell: Cell, problem: Problem) -> list[Finding]:
    """Errors about what the recorded poses leave open whatever was seen: known before anything is solved.

    Args:
        cell: As it is stated.
        problem: With the poses of its robots as recorded.
    """
    found = []
    for motion in motions(problem).values():
        names = gauge_partners(problem, motion)
        if names:
            which = is_unobservable([describe_twists(f"{motion.robot}_base", motion.twists_in_base)], names[1:])
            do, why = (advise_motion(cell, problem, motion),), sentence(describe_motion(motion), (motion.robot,))
            what = f"By the recorded poses alone, {which}."
            found.append(Finding("unobservable-direction", "error", names, what, do, why))
    return found
