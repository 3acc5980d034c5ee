"""Rendered images of a simulated cell's recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from basecal.cell import Recording, RobotState, Sample
from basecal.errors import InputError
from basecal.geometry import SE3
from basecal.planning.sketch import Sketch
from basecal.simulation.scenario import SimulatedCell
from basecal.vision.draw.led import LedSettings, render_led
from basecal.vision.draw.render import render
from basecal.vision.image_file import write_png

Progress = Callable[[int, int], None]


def render_recording(
    simulation: SimulatedCell, folder: Path, seed: int = 0, progress: Progress | None = None
) -> Recording:
    """Render an image for every view of a simulated cell; the recording with image paths instead of detections.

    For LEDs, a second image with the LED off is written as `background`.

    Args:
        simulation: The cell; its cameras need an image size, and its targets a shape.
        folder: The cell's folder; images are written to `recording/images/<camera>/`.
        seed: Seed of the image noise.
        progress: Receives the number of finished samples and the total number.

    Raises:
        InputError: if a camera observes poses or 3-D points, or a target that is not found in images.
    """
    samples = simulation.recording.samples
    rendered = []
    for index, sample in enumerate(samples):
        rendered.append(_render_sample(simulation, sample, index, folder, seed + index))
        if progress is not None:
            progress(index + 1, len(samples))
    return replace(simulation.recording, samples=tuple(rendered), folder=str(folder))


def _render_sample(
    simulation: SimulatedCell,
    sample: Sample,
    index: int,
    folder: Path,
    seed: int,
) -> Sample:
    images, background = {}, {}
    for observation in sample.observations:
        name = f"recording/images/{observation.camera}/{sample.sample:06d}"
        target = simulation.cell.targets[observation.target].target
        camera = simulation.cameras[observation.camera]
        if target is None or target.found_by is None or camera.size_px is None:
            raise InputError(f"{observation.camera} has no images of {observation.target}: simulate pixels instead")
        pose = camera_from_target(simulation, observation.camera, observation.target, index)
        if not target.sheets:
            settings, points = LedSettings(), pose @ target.points
            on = render_led(camera, points, settings, 2 * seed)
            off = render_led(camera, points, replace(settings, photons=0.0), 2 * seed + 1)
            images[observation.camera] = _write(folder, f"{name}.png", on)
            background[observation.camera] = _write(folder, f"{name}_off.png", off)
        else:
            images[observation.camera] = _write(folder, f"{name}.png", render(camera, target, pose, seed=seed))
    return replace(sample, observations=(), images=images, background=background)


def _write(folder: Path, name: str, image: Any) -> str:
    write_png(folder / name, image)
    return name


def camera_from_target(simulation: SimulatedCell, camera: str, target: str, index: int) -> SE3:
    """True pose of a target in a camera at a sample."""
    robots = {name: RobotState(poses[index]) for name, poses in simulation.true_base_from_flange.items()}
    return Sketch(simulation.cell, simulation.truth, (camera, target)).camera_from_target(Sample(index, robots=robots))
