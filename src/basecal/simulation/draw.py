"""Random draws of vectors, rotations, lenses and targets."""

from __future__ import annotations

import numpy as np

from basecal.cell.target import Target
from basecal.cell.targets.registry import TARGETS
from basecal.geometry import SE3, Array, Camera
from basecal.geometry.lenses.registry import model_lenses
from basecal.geometry.rotation import rotation_from_quaternion
from basecal.planning import candidates
from basecal.simulation.scenario import Scenario

Generator = np.random.Generator
SIZE_PX = (1280, 720)


def draw_in_ball(rng: Generator, n: int, radius: float) -> Array:
    """Draw vectors uniformly in a ball, (n, 3)."""
    return radius * candidates.draw_in_ball(rng, n)


def rotations(rng: Generator, n: int) -> Array:
    """Draw uniform random rotations, (n, 3, 3)."""
    q = rng.standard_normal((n, 4))
    return rotation_from_quaternion(q / np.linalg.norm(q, axis=-1, keepdims=True))


def tangents(rng: Generator, n: int, sigma: tuple[float, float]) -> Array:
    """Draw normal tangent vectors with sigmas (translation [m], rotation [rad]) per axis, (n, 6)."""
    noise: Array = rng.standard_normal((n, 6)) * np.repeat(sigma, 3)
    return noise


def mount(rng: Generator, is_point: bool) -> SE3:
    """Draw a mount: translation within 0.1 m, and a random rotation; no rotation for a `is_point`."""
    rotation = np.eye(3) if is_point else rotations(rng, 1)[0]
    return SE3(rotation, draw_in_ball(rng, 1, 0.1)[0])


def lens(rng: Generator, scenario: Scenario) -> Camera:
    """The scenario's lens, or a random lens of its model."""
    if scenario.camera is not None:
        return scenario.camera
    model = model_lenses(scenario.lens)[0]
    fx = rng.uniform(*model.USUAL_FOCAL_PX)
    fy = fx * rng.uniform(0.995, 1.005)
    cx, cy = np.array(SIZE_PX) / 2 - 0.5 + rng.uniform(-15, 15, 2)
    distortion = model.usual_distortion(rng)
    return Camera(scenario.lens, np.array([fx, fy, cx, cy, *distortion]), SIZE_PX)


def shape(rng: Generator, scenario: Scenario) -> Target:
    """The scenario's board, or a random target of its kind."""
    if scenario.board is not None:
        return scenario.board
    if scenario.target == "pose":
        return TARGETS["charuco"].usual(rng)
    return TARGETS["points" if scenario.target == "points3d" else scenario.target].usual(rng)
