"""Motions of the robots: random poses about a home, with every target in view."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from basecal.errors import InputError
from basecal.geometry import SE3, Array
from basecal.geometry.rotation import rotation_exp
from basecal.numerics.batch import concatenate, take
from basecal.planning.feasible import is_front_seen, points_in_image
from basecal.simulation import draw
from basecal.simulation.arms import Arm, solve_joints
from basecal.simulation.draw import Generator
from basecal.simulation.layout import View
from basecal.simulation.scenario import Scenario
from basecal.simulation.scene import Scene, front, is_flat

_DRAW_ROUNDS = 100
_MARGIN_PX = 2.0
_FEWEST_POINTS = 8
_LEAST_FACING_COSINE = 0.25

States = dict[str, SE3]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Motion:
    """Consecutive samples of one group of views.

    Attributes:
        group: Number of the group.
        recorded: Recorded poses of the flange by robot, (n,).
        true: True poses of the flange by robot, (n,).
        joints: Recorded joints by robot with joints, (n, joints) [rad].
    """

    group: int
    recorded: States
    true: States
    joints: Mapping[str, Array] = field(default_factory=dict)


def points_in_camera(scene: Scene, view: View, states: Mapping[str, SE3]) -> Array:
    """Points of a view's target in the camera, (n, points, 3) [m], with the robots at `states`, (n,)."""
    camera_from_target = scene.camera_from_target(view, dict(states))
    points: Array = camera_from_target[:, None] @ scene.shapes[view[1]].points
    return points


def seen_points(scene: Scene, scenario: Scenario, view: View, states: Mapping[str, SE3]) -> Mask:
    """Which points of a view are visible, (n, points); a board only from its front, and not at a grazing angle."""
    camera, target = view
    points = points_in_camera(scene, view, states)
    mask = points_in_image(scene.lenses[camera], points, _MARGIN_PX + 5 * scenario.pixel_px)
    if is_flat(scene.shapes[target]):
        normal = scene.camera_from_target(view, dict(states)).rotation @ front(scene.shapes[target])[:, 2]
        mask &= is_front_seen(normal, points.mean(1), _LEAST_FACING_COSINE)[:, None]
    return mask


def _visibility_mask(scene: Scene, scenario: Scenario, group: int, states: States) -> Mask:
    """Whether all views of a group show enough points of their targets, (n,)."""
    is_visible = np.ones(len(next(iter(states.values()))), dtype=bool)
    for view in scene.layout.groups[group]:
        is_seen = seen_points(scene, scenario, view, states)
        needed_count = min(_FEWEST_POINTS, is_seen.shape[1]) if scenario.partial else is_seen.shape[1]
        is_visible &= is_seen.sum(1) >= needed_count
    return is_visible


def _draw_poses(scene: Scene, scenario: Scenario, group: int, robot: str, n: int, rng: Generator) -> SE3:
    """Draw poses about the home, (n,): rotated about the target, which keeps it in view, and translated."""
    turn = rotation_exp(draw.draw_in_ball(rng, n, scenario.spread_rad))
    target = scene.layout.groups[group][0][1]
    pivot: Array = scene.body_pose(target, scene.homes[group]) @ scene.shapes[target].points.mean(0)
    shift = draw.draw_in_ball(rng, n, scenario.position_m)
    motion = SE3(turn, pivot + shift - turn @ pivot)
    base = scene.bases[robot]
    return base.inverse() @ motion @ base @ scene.homes[group][robot]


def _draw(
    scene: Scene, scenario: Scenario, group: int, resting: States, n: int, rng: Generator, arms: Mapping[str, Arm]
) -> Motion:
    """Draw `n` samples; robots in `resting` stay at one stop, the other robots of the group move.

    Raises:
        InputError: if too few poses show the target.
    """
    robots = scene.homes[group]
    stop_errors = {robot: SE3.exp(draw.tangents(rng, 1, scenario.robot_noise)) for robot in resting}
    batches: list[tuple[States, States, dict[str, Array]]] = []
    found = 0
    size = 2 * n + 16
    for _ in range(_DRAW_ROUNDS):
        recorded, true, joints = States(), States(), dict[str, Array]()
        is_reached = np.ones(size, dtype=bool)
        for robot in robots:
            is_moving = robot not in resting
            pose = _draw_poses(scene, scenario, group, robot, size, rng) if is_moving else resting[robot].repeat(size)
            noise = SE3.exp(draw.tangents(rng, size, scenario.robot_noise)) if is_moving else stop_errors[robot]
            recorded[robot], true[robot] = pose, pose @ noise
            if robot in arms:
                arm = arms[robot]
                joints[robot], is_solved = solve_joints(arm.chain, pose, arm.home)
                recorded[robot], true[robot] = arm.chain.forward(joints[robot]), arm.true.forward(joints[robot]) @ noise
                is_reached &= is_solved
        kept = _visibility_mask(scene, scenario, group, true) & is_reached
        batches.append(take((recorded, true, joints), kept))
        found += int(kept.sum())
        if found >= n:
            return Motion(group, *take(concatenate(batches), slice(0, n)))
    raise InputError(
        f"only {found} of {n} samples see the target after {_DRAW_ROUNDS * size} tries: "
        "make spread_rad, position_m or robot_noise smaller, or distance_m greater"
    )


def _resting_states(scene: Scene, group: int, robots: tuple[str, ...]) -> States:
    return {robot: scene.homes[group][robot] for robot in robots}


def _parts(
    scene: Scene, scenario: Scenario, group: int, n: int, rng: Generator, arms: Mapping[str, Arm]
) -> list[tuple[States, int]]:
    """Consecutive parts of a motion: poses of resting robots, and number of samples."""
    movers = scene.layout.movers(scene.layout.groups[group])
    if not scenario.spread_rad and not scenario.position_m:
        return [(_resting_states(scene, group, movers), n)]
    if scenario.arms == "both":
        return [({}, n)]
    if len(movers) < 2:
        raise InputError(f"arms {scenario.arms!r} needs two robots; layout {scenario.layout!r} has one: use 'both'")
    eye, hand = (movers[:1], movers[1:])
    hand_still, eye_still = _resting_states(scene, group, hand), _resting_states(scene, group, eye)
    if scenario.arms == "halves":
        return [(hand_still, n - n // 2), (eye_still, n // 2)]
    if scenario.arms == "stations":
        stops = _draw(scene, scenario, group, hand_still, min(scenario.stations, n), rng, arms).recorded[eye[0]]
        return [({eye[0]: stops[k]}, len(part)) for k, part in enumerate(np.array_split(np.arange(n), len(stops)))]
    return [(eye_still if scenario.arms == "eye_still" else hand_still, n)]


def draw_motions(scene: Scene, scenario: Scenario, rng: Generator, arms: Mapping[str, Arm]) -> list[Motion]:
    """Draw all samples of a scenario, divided evenly among its groups; parts without samples are omitted.

    Raises:
        InputError: if the scenario's arms do not suit its layout, or too few poses show the target.
    """
    parts = [
        (group, *part)
        for group, share in enumerate(np.array_split(np.arange(scenario.samples), len(scene.layout.groups)))
        if len(share)
        for part in _parts(scene, scenario, group, len(share), rng, arms)
    ]
    return [_draw(scene, scenario, group, still, n, rng, arms) for group, still, n in parts if n]
