"""Observations of the cameras in a motion, with noise."""

from __future__ import annotations

import numpy as np

from basecal.cell.recording import Observation, PixelObservation, PointObservation, PoseObservation
from basecal.geometry import SE3, Array
from basecal.simulation import draw
from basecal.simulation.draw import Generator
from basecal.simulation.layout import View
from basecal.simulation.motion import Mask, Motion, points_in_camera, seen_points
from basecal.simulation.scenario import Scenario
from basecal.simulation.scene import Scene


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
    """Observations in each sample of a motion."""
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
            report = _points if scenario.target == "points3d" else _pixels
            by_view.append(report(view, scene, scenario, points, seen, rng))
    return list(zip(*by_view, strict=True))
