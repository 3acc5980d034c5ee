"""Descriptions of the motion of robots, and advice on missing motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from basecal.cell import Cell
from basecal.errors import sentence
from basecal.estimation.observability.motions import STILL_RAD, Motion, base_names, motions, mount_names
from basecal.estimation.problem.problem import Problem
from basecal.estimation.view.target_points import SeenPoints
from basecal.numerics.spectral import dimension, principal_axes

# [rad] of rotation about a second axis, below which a robot counts as hardly rotated about it; assumed.
_LITTLE_ROTATION_RAD = 0.15
_SHOWN_DEG = 0.005  # [deg] below which two decimals show zero: derived from the format below


def advise_observability(
    cell: Cell, problem: Problem, motions: Mapping[str, Motion], names: Sequence[str]
) -> tuple[tuple[str, ...], str]:
    """Advise how to make unknowns observable, and give the reason from the motion of their robots.

    Args:
        cell: The cell.
        problem: The problem.
        motions: Motion of each robot, by name.
        names: Names of the unknowns.
    """
    apart = _advise_connection(problem, names) or _advise_points(problem, names)
    if apart is not None:
        return apart
    concerned = [
        m for robot, m in motions.items() if set(names) & {*mount_names(problem, robot), *base_names(problem, robot)}
    ]
    poor = [m for m in concerned if has_little_rotation(m)]
    carrying = [m for m in poor if set(names) & set(mount_names(problem, m.robot))] or poor
    if len(carrying) == 1:
        return (advise_motion(cell, problem, carrying[0]),), sentence(
            describe_motion(carrying[0]), (carrying[0].robot,)
        )
    if carrying:
        mounts = [n for m in carrying for n in mount_names(problem, m.robot) if problem.unknowns[n].status != "fixed"]
        causes = ", and ".join(map(describe_motion, carrying))
        return (f"Rotate each about two axes that are not parallel{_stated_alternative(mounts)}.",), sentence(
            causes, (m.robot for m in carrying)
        )
    do = "Add samples in which every arm is rotated about two axes that are not parallel, or state what is known."
    return (do,), "The views are too few or too similar."


def _advise_connection(problem: Problem, names: Sequence[str]) -> tuple[tuple[str, ...], str] | None:
    """Advice and reason if no view depends on the unknowns, or none relates these bases to others; else None."""
    groups = [group for group in problem.all_groups if set(names).intersection(group.frames)]
    it = "it" if len(names) == 1 else "them"
    if not groups:
        return (
            f"Record views that depend on {it}, or state {it} as fixed.",
        ), f"No view depends on {' and '.join(names)}."
    if not all(end.base in names for group in groups for end in group.ends):
        return None
    bases, reference = " and ".join(name.rpartition("_from_")[2] for name in names), f"{problem.reference}_base"
    do = f"Record views that relate {it} to {reference}, or state {names[0]} as a prior or fixed."
    return (do,), f"No view relates {bases} to {reference}."


def _advise_points(problem: Problem, names: Sequence[str]) -> tuple[tuple[str, ...], str] | None:
    """Advice and reason if the unknown is the mount of a target whose observed points are on one line; else None."""
    groups = [group for group in problem.groups if [group.hand.mount] == list(names)]
    seen = [m.points_in_target[m.seen.any(0)] for g in groups if isinstance(m := g.measurement, SeenPoints)]
    if not seen or len(seen) < len(groups) or dimension(np.concatenate(seen)) != 1:
        return None
    target = groups[0].target
    do = f"Add a point beside the line, or state {names[0]} as a prior or fixed."
    return (do,), f"All observed points of {target} are on one line."


def has_little_rotation(motion: Motion) -> bool:
    """Whether a robot hardly rotates about a second axis."""
    return bool(motion.turn_rad[1] < _LITTLE_ROTATION_RAD)


def describe_poor_motions(problem: Problem) -> str:
    """Describe the robots that hardly rotate about a second axis; empty if there are none."""
    return " and ".join(describe_motion(m) for m in motions(problem).values() if has_little_rotation(m))


def describe_motion(motion: Motion) -> str:
    """Describe the motion of a robot, such as "hand only translates, it rotates by at most 0.10 deg"."""
    robot, angle = motion.robot, np.degrees(motion.turn_rad)
    if motion.is_still:
        return f"{robot} never moves in {motion.samples} sample{'s' if motion.samples > 1 else ''}"
    if motion.is_translation_only:
        least = f", it rotates by at most {angle[0]:.2f} deg" if angle[0] >= _SHOWN_DEG else ""
        return f"{robot} only translates{least}"
    if has_little_rotation(motion):
        if motion.orientations == 2:
            return f"{robot} has two orientations only"
        first = motion.axes_in_base[:, 0]
        first = first * np.sign(first[np.argmax(np.round(np.abs(first), 3))])  # its largest component positive
        axis = ", ".join(f"{v + 0.0:.2f}" for v in np.round(first, 2))
        only = "" if motion.turn_rad[1] < STILL_RAD else " mostly"
        least = f", and by at most {angle[1]:.2f} deg about any other" if angle[1] >= _SHOWN_DEG else ""
        return f"{robot} rotates{only} about one axis, along ({axis}) in {robot}_base{least}"
    return f"{robot} rotates by up to {angle[0]:.0f} deg, and {angle[1]:.0f} deg about a second axis"


def advise_motion(cell: Cell, problem: Problem, motion: Motion) -> str:
    """Advice on samples of a robot, or on a statement about its mounts, that make more directions observable."""
    robot = motion.robot
    unknown = [n for n in mount_names(problem, robot) if problem.unknowns[n].status != "fixed"]
    known = _stated_alternative(unknown)
    chain = cell.robots[robot].chain
    # Such as the joint axes of a SCARA robot.
    axes_are_parallel = chain is not None and principal_axes(chain.jacobian(np.zeros(chain.n))[3:].T).dimension < 2
    if axes_are_parallel and not (motion.is_still or motion.is_translation_only):
        state = f"State {' and '.join(unknown or base_names(problem, robot))} as a prior or fixed"
        return f"{state}: all joint axes of {robot} are parallel, so that it cannot rotate about another."
    if motion.is_still:
        return f"Move {robot}, and rotate it about two axes that are not parallel{known}."
    if motion.is_translation_only:
        return f"Add poses that rotate {robot} about two axes that are not parallel{known}."
    if motion.turn_rad[0] < _LITTLE_ROTATION_RAD:
        return f"Rotate {robot} further, by 30 deg and more, about two axes that are not parallel{known}."
    return f"Add poses that rotate {robot} by 30 deg and more about another axis{known}."


def _stated_alternative(names: Sequence[str]) -> str:
    return f", or state {' and '.join(names)} as a prior or fixed" if names else ""
