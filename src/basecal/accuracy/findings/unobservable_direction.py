"""`unobservable-direction`: translations and rotations that the data do not determine, with the motions as cause."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.phrases.null_space import describe_direction, describe_twists, unobservable_clause
from basecal.accuracy.phrases.robot_motion import advise_motion, advise_observability, describe_motion
from basecal.cell import Cell, Finding
from basecal.errors import count_text, sentence
from basecal.estimation.observability.motions import gauge_partners, motions
from basecal.estimation.observability.null_space import NullDirection
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.view.points import is_touch
from basecal.geometry import Array


def unobservable_directions(evidence: Evidence) -> list[Finding]:
    """A finding for each null space of the solution, or if it did not converge, of the recorded poses alone."""
    pose_findings = (
        [] if evidence.solution.converged else unobservable_by_poses(evidence.cell, evidence.solution.problem)
    )
    if pose_findings:
        return pose_findings
    problem, observability = evidence.solution.problem, evidence.solution.observability
    robot_motions = motions(problem) if observability.null_space else {}
    phrases: dict[tuple[str, ...], list[str]] = {}
    advice: dict[tuple[str, ...], tuple[tuple[str, ...], str] | None] = {}
    for direction in observability.null_space:
        phrases.setdefault(direction.names, []).append(describe_direction(direction))
        advice.setdefault(direction.names, touch_advice(evidence.cell, problem, evidence.solution.state, direction))
    return [
        Finding(
            "unobservable-direction",
            "error" if observability.unobservable.intersection(evidence.cell.requested_transforms) else "warning",
            names,
            sentence(unobservable_clause(clauses, names[1:])),
            *(advice[names] or advise_observability(evidence.cell, problem, robot_motions, names)),
        )
        for names, clauses in phrases.items()
    ]


def unobservable_by_poses(cell: Cell, problem: Problem) -> list[Finding]:
    """Errors about directions that the recorded robot poses leave unobservable for any views; needs no solution.

    Args:
        cell: The cell as stated.
        problem: The problem with robot poses as recorded.
    """
    found = []
    for motion in motions(problem).values():
        names = gauge_partners(problem, motion)
        if names:
            clause = unobservable_clause([describe_twists(f"{motion.robot}_base", motion.twists_in_base)], names[1:])
            do, why = (advise_motion(cell, problem, motion),), sentence(describe_motion(motion), (motion.robot,))
            what = f"By the recorded poses alone, {clause}."
            found.append(Finding("unobservable-direction", "error", names, what, do, why))
    return found


_NEAR_M = 0.05  # [m] distance of a mark from an axis, within which the mark counts as on the axis; assumed
# [m] distance of the next mark from the axis: touches of 0.3 mm determine a rotation to 1 mrad, 0.3 mm over 0.3 m.
_OFF_M = 0.3


def touch_advice(
    cell: Cell, problem: Problem, state: State, direction: NullDirection
) -> tuple[tuple[str, ...], str] | None:
    """Advice on the next place to touch, and the reason; None if touches are not the cause.

    Args:
        cell: The cell.
        problem: The problem.
        state: State with the estimated positions of marks.
        direction: An unobservable rotation, in the axes of the reference robot's base.
    """
    seen = [g for g in problem.groups if direction.names[0] in g.frames]
    if direction.kind != "rotation" or not seen or not all(is_touch(g.measurement) for g in seen):
        return None
    if not direction.names[0].startswith(f"{cell.reference}_base_from_"):
        return None
    marks = _marks(cell, problem, state, sorted({g.target for g in seen}))
    tips = " and ".join(sorted({g.camera for g in problem.groups if g.target in marks}))
    near = [name for name, position in marks.items() if _distance(position, direction.twists_in_parent[0]) < _NEAR_M]
    if len(direction.twists_in_parent) == 1 and len(near) >= 2:
        which = "third" if len(marks) == 2 else "further"
        line = f"the line through {near[0]} and {near[1]}"
        do = f"Touch a {which} mark, at least {_OFF_M:g} m off {line}, with {tips}."
        return (do,), f"All marks that determine {direction.names[0].rpartition('_from_')[2]} are on one line."
    if not marks:
        return None
    do = f"Touch three marks, {_OFF_M:g} m apart and not on one line, with {tips}."
    return (do,), f"The touches of {count_text(len(marks), 'mark')} leave rotations of the base undetermined."


def _marks(cell: Cell, problem: Problem, state: State, names: Sequence[str]) -> dict[str, Array]:
    """Positions of marks in the base of the reference robot, (3,) [m] each, by name."""
    found = {}
    for group in problem.groups:
        target = cell.targets[group.target]
        if group.target in names and group.hand.robot is None and target.contact is None:
            position = state.transforms[group.hand.mount].translation
            found[target.name] = position if group.hand.base is None else state.transforms[group.hand.base] @ position
    return found


def _distance(point: Array, twist: Array) -> float:
    """Distance of a point, (3,), from the axis of a twist about the origin, (6,) [m]."""
    axis = twist[3:] / np.linalg.norm(twist[3:])
    through = np.cross(twist[3:], twist[:3]) / (twist[3:] @ twist[3:])
    return float(np.linalg.norm(np.cross(axis, point - through)))
