"""The true geometry of a cell, and home poses at which every camera sees its target."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.cell.cell import WORLD
from basecal.cell.target import Target
from basecal.geometry import SE3, Array, Camera
from basecal.geometry.rotation import rotation_exp
from basecal.simulation import draw
from basecal.simulation.draw import Generator
from basecal.simulation.layout import Layout, View
from basecal.simulation.scenario import Scenario

_CANDIDATE_COUNT = 128
_REACH_M = (0.25, 1.1)


@dataclass(frozen=True, eq=False)
class Scene:
    """True geometry of a cell.

    Attributes:
        layout: The layout.
        lenses: Lenses by camera.
        shapes: Shapes by target.
        bases: `world_from_base` by robot.
        mounts: `carrier_from_thing` by camera or target.
        homes: `base_from_flange` by robot for each group, at which its cameras see its targets.
        parked: `base_from_flange` of each robot while other robots are recorded.
    """

    layout: Layout
    lenses: dict[str, Camera]
    shapes: dict[str, Target]
    bases: dict[str, SE3]
    mounts: dict[str, SE3]
    homes: tuple[dict[str, SE3], ...]
    parked: dict[str, SE3]

    def body_pose(self, name: str, base_from_flange: dict[str, SE3]) -> SE3:
        """Pose of a camera or target in the world, (...), with the robots at `base_from_flange`, (...)."""
        carrier = self.layout.carrier(name)
        if carrier == WORLD:
            return self.mounts[name]
        return self.bases[carrier] @ base_from_flange[carrier] @ self.mounts[name]

    def camera_from_target(self, view: View, base_from_flange: dict[str, SE3]) -> SE3:
        """Pose of a view's target in its camera, (...), with the robots at `base_from_flange`, (...)."""
        camera, target = view
        seen = self.body_pose(camera, base_from_flange).inverse() @ self.body_pose(target, base_from_flange)
        return seen


def is_flat(target: Target) -> bool:
    """Whether the target is a board, which is visible only from its front."""
    return len(target.points) > 1 and not np.any(target.points[:, 2])


def front(target: Target) -> Array:
    """Axes of a board's front in the target's frame, as columns, (3, 3): x right and y down for a viewer."""
    return target.sheets[0].target_from_sheet.rotation if target.sheets else np.eye(3)


def _draw_bases(rng: Generator, robots: tuple[str, ...]) -> dict[str, SE3]:
    """Draw bases on a ring, neighbours 1 to 2 m apart, with any yaw and a moderate tilt; 20 % have any rotation."""
    n = len(robots)
    radius = rng.uniform(1.0, 2.0) / (2 * np.sin(np.pi / max(n, 2)))
    angle = rng.uniform(0, 2 * np.pi) + 2 * np.pi * np.arange(n) / n
    position = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(n)], -1)
    position += rng.uniform(-0.1, 0.1, (n, 3))
    yaw = rotation_exp(rng.uniform(-np.pi, np.pi, (n, 1)) * np.eye(3)[2])
    upright = yaw @ rotation_exp(draw.draw_in_ball(rng, n, 0.3))
    is_any_rotation = rng.random(n) < 0.2
    turned = np.where(is_any_rotation[:, None, None], draw.rotations(rng, n), upright)
    world_from_base = {name: SE3(turned[k], position[k] - position[0]) for k, name in enumerate(robots)}
    return {**world_from_base, robots[0]: SE3.identity()}


def _poses_in_reach(rng: Generator, n: int) -> SE3:
    """Draw poses of a flange, (n,): above the base, 0.4 to 0.8 m from it, with any rotation."""
    direction = rng.standard_normal((n, 3))
    direction[:, 2] = np.abs(direction[:, 2])
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    return SE3(draw.rotations(rng, n), rng.uniform(0.4, 0.8, (n, 1)) * direction)


def _draw_views(rng: Generator, scenario: Scenario, target: Target, n: int) -> SE3:
    """Draw poses `camera_from_target`, (n,), near the optical axis; a board shows its front."""
    rotation = draw.rotations(rng, n)
    if is_flat(target):
        roll = rotation_exp(rng.uniform(-np.pi, np.pi, (n, 1)) * np.eye(3)[2])
        rotation = rotation_exp(draw.draw_in_ball(rng, n, 0.4)) @ roll @ front(target).T
    distance = rng.uniform(*scenario.distance_m, (n, 1))
    centre = distance * np.concatenate([rng.uniform(-0.1, 0.1, (n, 2)), np.ones((n, 1))], -1)
    return SE3(rotation, centre - rotation @ target.points.mean(0))


def as_point(pose: SE3, target: Target) -> SE3:
    """The pose without rotation that keeps the position of the target's only point."""
    return SE3(np.broadcast_to(np.eye(3), pose.rotation.shape).copy(), pose @ target.points[0] - target.points[0])


def _place_body(
    name: str, world_from_thing: SE3, scene: Scene, flanges: dict[str, SE3], world_mounts: dict[str, SE3]
) -> None:
    """Set the pose of a camera or target: through its carrier's flange, or through its mount on the world."""
    carrier = scene.layout.carrier(name)
    target = scene.shapes.get(name)
    if carrier != WORLD:
        flanges[carrier] = world_from_thing @ scene.mounts[name].inverse()
    elif target is not None and target.is_point:
        world_mounts[name] = as_point(world_from_thing, target)
    else:
        world_mounts[name] = world_from_thing


def _draw_placements(
    group: tuple[View, ...], scene: Scene, scenario: Scenario, rng: Generator
) -> tuple[dict[str, SE3], dict[str, SE3]]:
    """Draw candidates of `world_from_flange` of a group's robots, and of mounts on the world."""
    first = scene.layout.movers(group)[0]
    flanges = {first: scene.bases[first] @ _poses_in_reach(rng, _CANDIDATE_COUNT)}
    fixed: dict[str, SE3] = {}

    def known_pose(name: str) -> SE3 | None:
        """Pose of a camera or a target in the world; None if it is not drawn yet."""
        carrier = scene.layout.carrier(name)
        return flanges[carrier] @ scene.mounts[name] if carrier in flanges else fixed.get(name)

    for camera, target in group:
        seen = _draw_views(rng, scenario, scene.shapes[target], _CANDIDATE_COUNT)
        world_from_camera, world_from_target = known_pose(camera), known_pose(target)
        if world_from_camera is not None:
            _place_body(target, world_from_camera @ seen, scene, flanges, fixed)
        elif world_from_target is not None:
            _place_body(camera, world_from_target @ seen.inverse(), scene, flanges, fixed)
    return flanges, fixed


def _best_homes(
    group: tuple[View, ...], scene: Scene, scenario: Scenario, rng: Generator
) -> tuple[dict[str, SE3], dict[str, SE3]]:
    """The best placement within the robots' reach: `base_from_flange`, and mounts on the world."""
    flanges, fixed = _draw_placements(group, scene, scenario, rng)
    homes = {robot: scene.bases[robot].inverse() @ flanges[robot] for robot in flanges}
    distance_m = np.stack([np.linalg.norm(home.translation, axis=-1) for home in homes.values()])
    out_of_reach = np.maximum(0, np.maximum(_REACH_M[0] - distance_m, distance_m - _REACH_M[1]))
    best = int(np.argmin(out_of_reach.sum(axis=0)))
    return {robot: home[best] for robot, home in homes.items()}, {name: pose[best] for name, pose in fixed.items()}


def draw_scene(scenario: Scenario, layout: Layout, rng: Generator) -> Scene:
    """Draw a scene of a layout; it does not depend on the noise and the statuses of the scenario."""
    shapes = {name: draw.shape(rng, scenario) for name in layout.targets}
    lenses = {name: draw.lens(rng, scenario) for name in layout.cameras}
    carried = {name: on for name, on in (*layout.cameras.items(), *layout.targets.items()) if on != WORLD}
    mounts = {name: draw.mount(rng, name in shapes and shapes[name].is_point) for name in carried}
    parked = {robot: _poses_in_reach(rng, 1)[0] for robot in layout.robots}
    bare_scene = Scene(layout, lenses, shapes, _draw_bases(rng, layout.robots), mounts, (), parked)
    homes_and_mounts = [_best_homes(group, bare_scene, scenario, rng) for group in layout.groups]
    world_mounts = {name: pose for _, fixed in homes_and_mounts for name, pose in fixed.items()}
    homes = tuple(home for home, _ in homes_and_mounts)
    return replace(bare_scene, mounts={**mounts, **world_mounts}, homes=homes)
