"""Random effects of a problem: the errors that the stops of each robot share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from basecal.effects.faces.effect import RandomEffect
from basecal.effects.faces.robot_parameter import Posture
from basecal.effects.faces.shared_errors import SharedErrors, SharedTerm
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.estimation.noise.laplace import SigmaPosterior
from basecal.estimation.noise.reml import posterior
from basecal.estimation.noise.robot_noise import count_stops, stands
from basecal.estimation.problem.build import recorded_by_joints
from basecal.estimation.problem.problem import Problem
from basecal.geometry import Array

FEWEST_STOPS = 4
"""Minimum number of stops to identify errors that change with the pose; assumed."""
_SUGGESTED = 2.0  # score in standard deviations above which a model is tried: exceeded by chance once in 44


def shared_errors(effect: RandomEffect, problem: Problem, robot: str) -> SharedErrors | None:
    """Shared errors of a robot's stops due to an effect; None if not identifiable, or if unknowns model the effect."""
    model = problem.robot_model(robot)
    if model is not None and not model.columns.keys().isdisjoint(effect.replaced_by):
        return None
    if effect.is_of_poses_alone and recorded_by_joints(problem, robot):
        return None
    if effect.by_times is not None:
        passed_s = passed_times(problem, robot)
        return None if np.isfinite(passed_s).sum() < FEWEST_STOPS else effect.by_times(passed_s)
    if effect.by_poses is not None:
        poses, seen = stands(problem, robot)
        few = count_stops(problem, robot) < FEWEST_STOPS
        return None if few else effect.by_poses(poses[np.flatnonzero(seen)], poses)
    at = posture_at_stops(problem, robot)
    return None if at is None or effect.by_joints is None else effect.by_joints(at)


def shared_term(problem: Problem, name: str, robots: Sequence[str]) -> SharedTerm | None:
    """Shared errors of some robots due to an effect; None if no robot has any, or if the name is empty.

    Of an effect of motion, a view cannot separate the errors of its two arms: one arm carries the errors of both.
    """
    if not name:
        return None
    effect = RANDOM_EFFECTS[name]
    found = {robot: shared_errors(effect, problem, robot) for robot in robots}
    shared = {robot: errors for robot, errors in found.items() if errors is not None}
    if effect.by_times is not None:
        firsts = [next((robot for robot in group.robots if robot in shared), "") for group in problem.groups]
        shared = {robot: shared[robot] for robot in dict.fromkeys(firsts) if robot}
    return SharedTerm(shared, effect.expected) if shared else None


def held_errors(problem: Problem, common: Mapping[str, Mapping[str, Array]]) -> dict[str, Array]:
    """Derivative of robots' flange poses with respect to shared errors in units of known sigmas, (stops, 6, k).

    Args:
        problem: The problem with the stops.
        common: Sigmas of translations [m] and rotations [rad], (2,), by effect and robot.
    """
    moves: dict[str, list[Array]] = {}
    for name, by_robot in common.items():
        for robot, sigmas in by_robot.items():
            errors = shared_errors(RANDOM_EFFECTS[name], problem, robot)
            if errors is not None:
                moves.setdefault(robot, []).append(errors.by_stop * sigmas[errors.is_turn.astype(np.int64)])
    return {robot: np.concatenate(of, axis=-1) for robot, of in moves.items()}


def has_similar_errors(plain: SigmaPosterior, errors: Mapping[str, SharedErrors]) -> bool:
    """Whether the stop errors of some robot are correlated as its shared errors predict; see `is_shared_error`."""
    stop_errors = posterior(plain.model, plain.logs).stop_errors
    robots, places = np.array(plain.model.robot_of_stop, dtype=object), plain.model.sigmas.stops
    units = {robot: np.repeat(np.exp(plain.logs[places[robot]]), 3) for robot in errors}
    return any(is_shared_error(of, stop_errors[robots == robot] / units[robot]) for robot, of in errors.items())


def is_shared_error(errors: SharedErrors, stop_errors: Array) -> bool:
    """Score test of independence of stop errors, (stops, 6) in sigmas, against an effect; True if it is rejected.

    The score is the sum over all pairs of stops of the product of their errors, weighted by their covariance under the
    effect. If signs are random, its mean is 0 and its variance is twice the sum of squares.
    Source: docs/mathematics.md (5.6).
    """
    moved = np.einsum("nck,nc->nk", errors.by_stop, stop_errors)
    own = np.vecdot(moved, moved)
    pairs = float(np.sum(moved.sum(0) ** 2) - own.sum())
    variance = 2 * float(np.sum((moved.T @ moved) ** 2) - own @ own)
    return bool(pairs > _SUGGESTED * np.sqrt(max(variance, 0.0)))


def passed_times(problem: Problem, robot: str) -> Array:
    """Times at which a robot moved through each of its stops, (stops,) [s]; NaN if it stood still."""
    out = np.full(len(stands(problem, robot)[1]), np.nan)
    for end in problem.robot_ends(robot):
        if end.passed_s is not None:
            out[end.stop_number] = end.passed_s
    return out


def posture_at_stops(problem: Problem, robot: str) -> Posture | None:
    """Stated kinematic chain at the joints of each stop; None with few stops, or if some stops have no joints.

    Stops without views are not used; they have the mean joints of the others.
    """
    chain = problem.chains.get(robot)
    if chain is None or not recorded_by_joints(problem, robot) or count_stops(problem, robot) < FEWEST_STOPS:
        return None
    seen = stands(problem, robot)[1]
    joints = np.zeros((len(seen), chain.n))
    for end in problem.robot_ends(robot):
        joints[end.stop_number] = end.joints
    joints[~seen] = joints[seen].mean(0)
    return Posture(chain, joints, chain.posture(joints))
