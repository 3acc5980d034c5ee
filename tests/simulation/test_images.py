"""Tests of rendered images of a simulated cell against its recording."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.errors import InputError
from basecal.simulation import Scenario, simulate
from basecal.simulation.images import camera_from_target, render_recording
from basecal.simulation.scenario import ObservedKind


def test_rendered_samples_have_images_without_observations(tmp_path: Path):
    """Every sample names an image of the camera's size and has no observation."""
    s = simulate(Scenario(samples=3), seed=0)
    steps = []
    recording = render_recording(s, tmp_path, progress=lambda *count: steps.append(count))
    assert steps == [(1, 3), (2, 3), (3, 3)]
    for sample in recording.samples:
        image = cv2.imread(str(tmp_path / sample.images["wrist"]), cv2.IMREAD_UNCHANGED)
        assert image.shape == (720, 1280)
        assert sample.observations == ()


def test_true_poses_project_to_the_recorded_pixels():
    """Noiseless pixels are the projection by the true transforms, including the noise of robots."""
    s = simulate(Scenario(samples=4, pixel_px=0.0, robot_noise=(1e-3, 1e-3)), seed=1)
    board = s.cell.targets["board"].target
    for index, sample in enumerate(s.recording.samples):
        (seen,) = sample.observations
        at = camera_from_target(s, "wrist", "board", index) @ board.points[board.rows(seen.ids)]
        np.testing.assert_allclose(s.cameras["wrist"].project(at), seen.pixels, atol=1e-6)


def test_led_is_rendered_on_and_off(tmp_path: Path):
    """The difference of both images is brightest at the LED."""
    s = simulate(Scenario(samples=1, target="led", camera_mount="fixed", target_mount="fixed", pixel_px=0.0), seed=0)
    (sample,) = render_recording(s, tmp_path).samples
    on, off = (
        cv2.imread(str(tmp_path / path), cv2.IMREAD_UNCHANGED).astype(float)
        for path in (sample.images["wrist"], sample.background["wrist"])
    )
    brightest = np.unravel_index(np.argmax(on - off), on.shape)
    np.testing.assert_allclose(brightest[::-1], s.recording.samples[0].observations[0].pixels[0], atol=1.5)


@pytest.mark.parametrize("target", ["pose", "points3d", "points"])
def test_undetectable_targets_have_no_images(tmp_path: Path, target: ObservedKind):
    """A camera that measures poses, and indistinguishable points, are refused in one sentence."""
    with pytest.raises(InputError, match="has no images"):
        render_recording(simulate(Scenario(samples=1, target=target), seed=0), tmp_path)
    assert not [*tmp_path.iterdir()]
