"""Tests of the simulated cells of a study."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.studies.cells import _scenario, simulate_cell, statuses
from study_example import SMALL, study

LAYOUTS = ["dual", "eye_in_hand", "eye_to_hand", "two_cameras", "two_world_cameras", "chain", "shifts"]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_statuses_match_the_simulated_cell(layout: str) -> None:
    """Names and statuses are known before a cell is simulated."""
    settings = study(hold=f"layout: {layout}, {SMALL}, camera_mount: prior").points[0].settings
    made = simulate_cell(settings, 3)
    stated = {name: unknown.status for name, unknown in made.cell.transforms.items()}
    assert statuses(settings) == stated
    assert made.truth.keys() == stated.keys()


def test_shifted_led_pixels_match_truth() -> None:
    """Without noise the recorded pixels are the prediction of the truth, at the requested distance within a fifth."""
    settings = study(hold="layout: shifts, distance_m: 2.0, pixel_px: 0.0").points[0].settings
    made = simulate_cell(settings, 1)
    base = made.truth["eye_base_from_hand_base"]
    for sample in made.recording.samples:
        eye, hand = (sample.robots[name].base_from_flange for name in ("eye", "hand"))
        seen = (eye.inverse() @ base @ hand).translation
        assert 1.6 < seen[2] < 2.5
        np.testing.assert_allclose(sample.observations[0].pixels[0], made.cameras["camera"].project(seen), atol=1e-9)


def test_truth_depends_on_seed_alone() -> None:
    """The truth of a seed is the same for every noise."""
    first, other = study(axes="pixel_px: [0.1, 0.5]", hold=SMALL).points
    truths = [simulate_cell(point.settings, 5).truth["eye_base_from_hand_base"].matrix for point in (first, other)]
    assert np.array_equal(*truths)


def test_shifted_led_is_near_the_axis() -> None:
    """The LED is within a fifth of the set distance, and off the axis by at most a tenth of it.

    Bases are 1.5 m apart.
    """
    settings = study(hold="layout: shifts, distance_m: 2.0, pixel_px: 0.0, shift_m: 0.001").points[0].settings
    found = []
    for seed in range(40):
        made = simulate_cell(settings, seed)
        base = made.truth["eye_base_from_hand_base"]
        assert np.linalg.norm(base.translation) == pytest.approx(1.5)
        sample = made.recording.samples[0]
        eye, hand = (sample.robots[name].base_from_flange for name in ("eye", "hand"))
        assert np.abs(eye.translation).max() <= 0.502
        found.append((eye.inverse() @ base @ hand).translation)
    places = np.array(found)
    assert 1.59 < places[:, 2].min() < 1.7
    assert 2.3 < places[:, 2].max() < 2.41
    off = places[:, :2] / places[:, 2:]
    assert np.abs(off).max() < 0.102
    assert off.min() < -0.05
    assert off.max() > 0.05


@pytest.mark.parametrize(
    ("hold", "noise"),
    [
        ("robot_sigma_t_m: 1e-4, robot_sigma_r_rad: 1e-3", [1e-4] * 3 + [1e-3] * 3),
        ("robot_sigma_t_m: 1e-4", [1e-4] * 3 + [0.0] * 3),
        ("robot_sigma_t_m: 1e-4, state_robot_noise: false", None),
        ("pixel_px: 0.1", None),
    ],
)
@pytest.mark.parametrize("layout", ["shifts", "paper"])
def test_robot_noise_of_shifts_is_stated_on_request(layout: str, hold: str, noise: list[float] | None) -> None:
    """The stated noise has the sigmas of translations first."""
    robots = simulate_cell(study(hold=f"layout: {layout}, {hold}").points[0].settings, 0).cell.robots.values()
    for robot in robots:
        assert (robot.noise is None) == (noise is None)
        if noise is not None:
            np.testing.assert_array_equal(robot.noise, noise)


def test_view_distances_are_within_a_fifth() -> None:
    """The distances of views are from a fifth nearer to a fifth farther than set."""
    scenario = _scenario(study(hold="distance_m: 2.0, robot_sigma_t_m: 1e-4").points[0].settings)
    assert scenario.distance_m == pytest.approx((1.6, 2.4))
    assert scenario.robot_noise == (1e-4, 0.0)


@pytest.mark.parametrize(
    ("hold", "stated"), [("pixel_px: 0.3", 0.3), ("pixel_px: 0.3, state_pixel_noise: false", None)]
)
@pytest.mark.parametrize("layout", ["shifts", "paper"])
def test_pixel_noise_of_shifts_is_stated_on_request(layout: str, hold: str, stated: float | None) -> None:
    """If pixel noise is unstated, the recording is exact, and noise is drawn for each trial."""
    made = simulate_cell(study(hold=f"layout: {layout}, {hold}").points[0].settings, 0)
    exact = simulate_cell(study(hold=f"layout: {layout}, pixel_px: 0.0").points[0].settings, 0)
    assert made.cell.pixel_px == stated
    pixels, without = (np.array([s.observations[0].pixels for s in each.recording.samples]) for each in (made, exact))
    assert np.array_equal(pixels, without) == (stated is None)
