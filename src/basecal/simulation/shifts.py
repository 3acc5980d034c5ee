"""Recordings of the paper's method: a camera at rest observes an LED that is shifted along its axes."""

from __future__ import annotations

import numpy as np

from basecal.cell import (
    Cell,
    CellCamera,
    CellTarget,
    Intrinsics,
    PixelObservation,
    Recording,
    Robot,
    RobotState,
    Sample,
    Unknown,
)
from basecal.cell.targets.led import led_target
from basecal.geometry import SE3, Array, Camera
from basecal.planning.shifts import DIRECTIONS
from basecal.simulation.scenario import SimulatedCell

_ZERO_NOISE_PX = 1e-9


def shift_directions(is_two_sided: bool) -> Array:
    """Positions of the LED at a station in units of the shift, (4, 3) or (7, 3); the first is the origin."""
    return DIRECTIONS if is_two_sided else DIRECTIONS[:4]


def simulate_shifts(
    eye_base_from_hand_base: SE3,
    eye_base_from_camera: SE3,
    hand_base_from_led: SE3,
    camera: Camera,
    shift_m: float,
    is_two_sided: bool = False,
    pixel_px: float = 0.0,
    seed: int = 0,
) -> SimulatedCell:
    """Simulate a cell whose camera observes an LED shifted along its own axes, at one or several stations.

    Args:
        eye_base_from_hand_base: The true pose between the bases.
        eye_base_from_camera: Poses of the camera, (stations,).
        hand_base_from_led: Poses of the LED before its shifts, (stations,).
        camera: The lens.
        shift_m: Length of the shifts [m].
        is_two_sided: Whether the LED is shifted in both directions along each axis.
        pixel_px: Sigma of a pixel coordinate [px].
        seed: Seed of the noise.
    """
    rng = np.random.default_rng(seed)
    samples, flanges = list[Sample](), list[tuple[SE3, SE3]]()
    for eye, led in zip(eye_base_from_camera, hand_base_from_led, strict=True):
        for shift in shift_m * shift_directions(is_two_sided):
            hand = led @ SE3(np.eye(3), shift)
            flanges.append((eye, hand))
            position = (eye.inverse() @ eye_base_from_hand_base @ hand).translation
            pixel = camera.project(position) + pixel_px * rng.normal(size=2)
            seen = PixelObservation("camera", "light", np.zeros(1, dtype=np.int64), pixel[None])
            samples.append(Sample(len(samples), None, {"eye": RobotState(eye), "hand": RobotState(hand)}, (seen,)))
    known = Unknown("fixed", SE3.identity())
    cell = Cell(
        reference="eye",
        robots={"eye": Robot("eye"), "hand": Robot("hand")},
        bases={"hand": Unknown()},
        cameras={
            "camera": CellCamera("camera", "eye", known, camera.model, camera.size_px, Intrinsics("fixed", camera))
        },
        targets={"light": CellTarget("light", "hand", known, led_target())},
        pixel_px=pixel_px if pixel_px > _ZERO_NOISE_PX else None,
    )
    truth = {
        "eye_base_from_hand_base": eye_base_from_hand_base,
        "eye_flange_from_camera": SE3.identity(),
        "hand_flange_from_light": SE3.identity(),
    }
    recording = Recording(tuple(samples))
    true_poses = {name: SE3.stack([each[k] for each in flanges]) for k, name in enumerate(("eye", "hand"))}
    return SimulatedCell(cell, recording, truth, {"camera": camera}, true_poses)
