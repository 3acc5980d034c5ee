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
"""Fewer stops show nothing of what changes with the pose; assumed."""
_SUGGESTED = 2.0  # standard deviations, above which a model is tried: a normal number is beyond once in 44


def shared_errors(effect: RandomEffect, problem: Problem, robot: str) -> SharedErrors | None:
    """The errors that a robot's stops share by an effect; None if they show none of it, or it is an unknown."""
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
    """The errors that stops share by an effect, of those of some robots that show some; None without any, or a name.

    No view shows whether it was the camera's arm or the target's that was off: one has the errors of both.
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
    """How robots' flanges move at stops with errors of known sigmas that stops share, in these, (stops, 6, k).

    Args:
        problem: With the stops.
        common: By effect and robot, sigmas of a shift [m] and a turn [rad].
    """
    moves: dict[str, list[Array]] = {}
    for name, by_robot in common.items():
        for robot, sigmas in by_robot.items():
            errors = shared_errors(RANDOM_EFFECTS[name], problem, robot)
            if errors is not None:
                moves.setdefault(robot, []).append(errors.by_stop * sigmas[errors.is_turn.astype(np.int64)])
    return {robot: np.concatenate(of, axis=-1) for robot, of in moves.items()}


def has_similar_errors(plain: SigmaPosterior, errors: Mapping[str, SharedErrors]) -> bool:
    """Whether the errors of some robot's stops are more similar than by chance where they share errors."""
    stop_errors = posterior(plain.model, plain.logs).stop_errors
    robots, places = np.array(plain.model.robot_of_stop, dtype=object), plain.model.sigmas.stops
    units = {robot: np.repeat(np.exp(plain.logs[places[robot]]), 3) for robot in errors}
    return any(is_shared_error(of, stop_errors[robots == robot] / units[robot]) for robot, of in errors.items())


def is_shared_error(errors: SharedErrors, stop_errors: Array) -> bool:
    """Whether errors of stops, (stops, 6) in sigmas, are more similar than independent ones, by a score test.

    Products of those of all pairs, weighed by their covariance under the effect, have the sum 0 on average if signs
    are chance. Its variance is twice the sum of the squares.
    Source: docs/mathematics.md (5.6).
    """
    moved = np.einsum("nck,nc->nk", errors.by_stop, stop_errors)
    own = np.vecdot(moved, moved)
    pairs = float(np.sum(moved.sum(0) ** 2) - own.sum())
    variance = 2 * float(np.sum((moved.T @ moved) ** 2) - own @ own)
    return bool(pairs > _SUGGESTED * np.sqrt(max(variance, 0.0)))


def passed_times(problem: Problem, robot: str) -> Array:
    """When a robot moved through each of its stops, by number [s]; NaN of those where it stood, (stops,)."""
    out = np.full(len(stands(problem, robot)[1]), np.nan)
    for end in problem.robot_ends(robot):
        if end.passed_s is not None:
            out[end.stand] = end.passed_s
    return out


def posture_at_stops(problem: Problem, robot: str) -> Posture | None:
    """The chain as stated at the joints of each stop, by number; None of few stops, or if not all have joints.

    Stops at which nothing was seen, and that nothing requests, have the mean of the others' joints.
    """
    chain = problem.chains.get(robot)
    if chain is None or not recorded_by_joints(problem, robot) or count_stops(problem, robot) < FEWEST_STOPS:
        return None
    seen = stands(problem, robot)[1]
    joints = np.zeros((len(seen), chain.n))
    for end in problem.robot_ends(robot):
        joints[end.stand] = end.joints
    joints[~seen] = joints[seen].mean(0)
    return Posture(chain, joints, chain.posture(joints))
