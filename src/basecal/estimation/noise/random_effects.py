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
from basecal.estimation.noise.robot_noise import count_stops, stop_poses
from basecal.estimation.problem.build import recorded_by_joints
from basecal.estimation.problem.problem import Problem
from basecal.geometry import Array

FEWEST_STOPS = 4
"""Minimum number of stops to identify errors that change with the pose; assumed."""
_LEAST_SCORE = 2.0  # score in standard deviations above which a model is tried: exceeded by chance once in 44


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
        poses, seen = stop_poses(problem, robot)
        has_few_stops = count_stops(problem, robot) < FEWEST_STOPS
        return None if has_few_stops else effect.by_poses(poses[np.flatnonzero(seen)], poses)
    posture = posture_at_stops(problem, robot)
    return None if posture is None or effect.by_joints is None else effect.by_joints(posture)


def shared_term(problem: Problem, name: str, robots: Sequence[str]) -> SharedTerm | None:
    """Shared errors of some robots due to an effect; None if no robot has any, or if the name is empty.

    A view cannot separate the motion errors of its two arms. For an effect of motion, one arm has the errors of both.
    """
    if not name:
        return None
    effect = RANDOM_EFFECTS[name]
    by_robot = {robot: shared_errors(effect, problem, robot) for robot in robots}
    shared = {robot: errors for robot, errors in by_robot.items() if errors is not None}
    if effect.by_times is not None:
        firsts = [next((robot for robot in group.robots if robot in shared), "") for group in problem.groups]
        shared = {robot: shared[robot] for robot in dict.fromkeys(firsts) if robot}
    return SharedTerm(shared, effect.expected) if shared else None


def scaled_shared_errors(problem: Problem, common: Mapping[str, Mapping[str, Array]]) -> dict[str, Array]:
    """Derivative of robots' flange poses with respect to shared errors in units of known sigmas, (stops, 6, k).

    Args:
        problem: The problem with the stops.
        common: Sigmas of translations [m] and rotations [rad], (2,), by effect and robot.
    """
    jacobians: dict[str, list[Array]] = {}
    for name, by_robot in common.items():
        for robot, sigmas in by_robot.items():
            errors = shared_errors(RANDOM_EFFECTS[name], problem, robot)
            if errors is not None:
                jacobians.setdefault(robot, []).append(errors.by_stop * sigmas[errors.is_turn.astype(np.int64)])
    return {robot: np.concatenate(parts, axis=-1) for robot, parts in jacobians.items()}


def has_similar_errors(plain: SigmaPosterior, errors: Mapping[str, SharedErrors]) -> bool:
    """Whether the stop errors of some robot are correlated as its shared errors predict; see `is_shared_error`."""
    stop_errors = posterior(plain.model, plain.logs).stop_errors
    robots, places = np.array(plain.model.robot_of_stop, dtype=object), plain.model.sigmas.stops
    units = {robot: np.repeat(np.exp(plain.logs[places[robot]]), 3) for robot in errors}
    return any(
        is_shared_error(effect_errors, stop_errors[robots == robot] / units[robot])
        for robot, effect_errors in errors.items()
    )


def is_shared_error(errors: SharedErrors, stop_errors: Array) -> bool:
    """Score test of independence of stop errors, (stops, 6) in sigmas, against an effect; True if it is rejected.

    The score is the sum over all pairs of stops of the product of their errors, weighted by their covariance under the
    effect. If signs are random, its mean is 0 and its variance is twice the sum of squares.
    Source: docs/mathematics.md (5.6).
    """
    scores = np.einsum("nck,nc->nk", errors.by_stop, stop_errors)
    stop_squares = np.vecdot(scores, scores)
    score = float(np.sum(scores.sum(0) ** 2) - stop_squares.sum())
    variance = 2 * float(np.sum((scores.T @ scores) ** 2) - stop_squares @ stop_squares)
    return bool(score > _LEAST_SCORE * np.sqrt(max(variance, 0.0)))


def passed_times(problem: Problem, robot: str) -> Array:
    """Times at which a robot moved through each of its stops, (stops,) [s]; NaN if it stood still."""
    times = np.full(len(stop_poses(problem, robot)[1]), np.nan)
    for end in problem.robot_ends(robot):
        if end.passed_s is not None:
            times[end.stop_number] = end.passed_s
    return times


def posture_at_stops(problem: Problem, robot: str) -> Posture | None:
    """Stated kinematic chain at the joints of each stop; None with few stops, or if some stops have no joints.

    Stops without views are not used; they have the mean joints of the others.
    """
    chain = problem.chains.get(robot)
    if chain is None or not recorded_by_joints(problem, robot) or count_stops(problem, robot) < FEWEST_STOPS:
        return None
    seen = stop_poses(problem, robot)[1]
    joints = np.zeros((len(seen), chain.n))
    for end in problem.robot_ends(robot):
        joints[end.stop_number] = end.joints
    joints[~seen] = joints[seen].mean(0)
    return Posture(chain, joints, chain.posture(joints))
