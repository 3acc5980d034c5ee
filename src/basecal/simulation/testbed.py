"""Simulation of a cell with known truth, and of its recording."""

from __future__ import annotations

import numpy as np

from basecal.cell.recording import (
    Observation,
    PixelObservation,
    PointObservation,
    PoseObservation,
    Recording,
    RobotState,
    Sample,
)
from basecal.errors import check_integer, check_type
from basecal.geometry import SE3, Array
from basecal.numerics.batch import concatenate
from basecal.simulation import draw
from basecal.simulation.arms import with_arms
from basecal.simulation.draw import Generator
from basecal.simulation.layout import View, make_layout
from basecal.simulation.motion import Mask, Motion, draw_motions, points_in_camera, seen_points
from basecal.simulation.scenario import Scenario, SimulatedCell
from basecal.simulation.scene import Scene, draw_scene
from basecal.simulation.stated_cell import stated_cell, truth


def _concatenate_motions(motions: list[Motion], scene: Scene, is_recorded: bool) -> dict[str, SE3]:
    """Poses of every robot in every sample, (samples,); a robot is parked while others are recorded."""
    poses: dict[str, list[SE3]] = {robot: [] for robot in scene.layout.robots}
    for motion in motions:
        states = motion.recorded if is_recorded else motion.true
        count = len(next(iter(states.values())))
        for robot, parts in poses.items():
            parts.append(states.get(robot, scene.parked[robot].repeat(count)))
    return {robot: concatenate(parts) for robot, parts in poses.items()}


def simulate(scenario: Scenario, seed: int) -> SimulatedCell:
    """Simulate a cell of a scenario, its recording, and the truth.

    The truth of a seed does not depend on the noise, the statuses, the motion and the number of samples. A robot
    outside the recorded pair is parked, and recorded without error.

    Raises:
        InputError: if the scenario's arms do not suit its layout, too few poses show the target, or the seed is not an
            integer >= 0.
    """
    check_type("scenario", scenario, Scenario)
    check_integer("seed", seed, 0)
    for_scene, for_motion, for_noise, for_priors, for_arms = np.random.default_rng(seed).spawn(5)
    scene = draw_scene(scenario, make_layout(scenario.layout, scenario.robots), for_scene)
    scene, arms = with_arms(scene, scenario, for_arms) if scenario.joints else (scene, {})
    motions = draw_motions(scene, scenario, for_motion, arms)
    observed = [observations for motion in motions for observations in observe(motion, scene, scenario, for_noise)]
    poses = _concatenate_motions(motions, scene, is_recorded=True)
    joints = {robot: np.concatenate([motion.joints[robot] for motion in motions]) for robot in motions[0].joints}

    def states(motion: Motion, k: int) -> dict[str, RobotState]:
        """The recorded states of the robots in a sample."""
        robots = scene.layout.robots if scene.layout.records_all else tuple(motion.recorded)
        return {r: RobotState(joints_rad=joints[r][k]) if r in joints else RobotState(poses[r][k]) for r in robots}

    motion_of_sample = [motion for motion in motions for _ in range(len(next(iter(motion.recorded.values()))))]
    samples = tuple(
        Sample(k, float(k), states(motion, k), observations)
        for k, (motion, observations) in enumerate(zip(motion_of_sample, observed, strict=True))
    )
    cell = stated_cell(scene, scenario, for_priors, arms)
    true = _concatenate_motions(motions, scene, is_recorded=False)
    robots = {robot: arm.true for robot, arm in arms.items()}
    return SimulatedCell(cell, Recording(samples), truth(scene, cell), scene.lenses, true, robots)


def _pixels(
    view: View, scene: Scene, scenario: Scenario, points: Array, visible: Mask, rng: Generator
) -> list[Observation]:
    camera, target = view
    pixels = scene.lenses[camera].project(points)
    pixels += scenario.pixel_px * rng.standard_normal(pixels.shape)
    if scenario.correlated_px:
        pixels += scenario.correlated_px * rng.standard_normal((len(pixels), 1, 2))
    ids = scene.shapes[target].ids
    return [
        PixelObservation(camera, target, ids[mask], found[mask]) for found, mask in zip(pixels, visible, strict=True)
    ]


def _points(
    view: View, scene: Scene, scenario: Scenario, points: Array, visible: Mask, rng: Generator
) -> list[Observation]:
    noisy = points + scenario.point_m * rng.standard_normal(points.shape)
    ids = scene.shapes[view[1]].ids
    stated = scenario.state_observation_noise and scenario.point_m > 0
    return [
        PointObservation(*view, ids[mask], found[mask], np.full(mask.sum(), scenario.point_m) if stated else None)
        for found, mask in zip(noisy, visible, strict=True)
    ]


def observe(motion: Motion, scene: Scene, scenario: Scenario, rng: Generator) -> list[tuple[Observation, ...]]:
    """Simulate the observations in each sample of a motion."""
    by_view: list[list[Observation]] = []
    for view in scene.layout.groups[motion.group]:
        if scenario.target == "pose":
            camera_from_target = scene.camera_from_target(view, motion.true)
            noisy = camera_from_target @ SE3.exp(draw.tangents(rng, len(camera_from_target), scenario.pose_noise))
            stated = scenario.state_observation_noise and any(scenario.pose_noise)
            sigma = np.repeat(scenario.pose_noise, 3) if stated else None
            by_view.append([PoseObservation(*view, noisy[k], sigma) for k in range(len(noisy))])
        else:
            points = points_in_camera(scene, view, motion.true)
            seen = seen_points(scene, scenario, view, motion.true)
            simulate_view = _points if scenario.target == "points3d" else _pixels
            by_view.append(simulate_view(view, scene, scenario, points, seen, rng))
    return list(zip(*by_view, strict=True))
