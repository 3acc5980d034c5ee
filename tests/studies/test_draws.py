"""Tests of draws of noise for a cell."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.studies.cells import Settings
from basecal.studies.draws import Draws, _robot_errors, draw, draw_cell
from study_example import SMALL, study


def make_draws(hold: str, count: int = 400, seed: int = 0) -> tuple[Draws, Settings]:
    settings = study(hold=f"{SMALL}, {hold}").points[0].settings
    return draw(draw_cell(settings, seed, 0, None), settings, (seed, 0, 0), count), settings


def test_draws_are_independent_of_their_count() -> None:
    """Ten draws are the first ten of twenty, including the errors of robots."""
    hold = "pixel_px: 0.2, robot_sigma_t_m: 1e-4, robot_sigma_r_rad: 1e-4"
    few, many = (make_draws(hold, count)[0].measurement().pixels for count in (10, 20))
    assert np.array_equal(few, many[:10])


def test_pixel_noise_has_stated_sigma() -> None:
    """The spread over draws is the stated one within 3 %: 400 draws of 8 x 12 x 2 numbers, 0.4 % of chance."""
    assert make_draws("pixel_px: 0.3")[0].measurement().pixels.std(0).mean() == pytest.approx(0.3, rel=0.03)


def test_correlated_noise_is_shared_by_a_view() -> None:
    """Without noise of single points, all points of a view have the same error."""
    pixels = make_draws("pixel_px: 0.0, correlated_px: 0.5")[0].measurement().pixels
    off = pixels - pixels.mean(0)
    assert np.abs(off - off.mean(2, keepdims=True)).max() < 1e-9
    assert off[:, :, 0].std() == pytest.approx(0.5, rel=0.03)


def test_robot_errors_move_pixels() -> None:
    """Recorded poses are unchanged, and pixels move by about focal length times angle.

    One error is shared by all points of a view.
    """
    draws, _ = make_draws("pixel_px: 0.0, robot_sigma_r_rad: 1e-3")
    assert draws.problem.groups[0].eye.base_from_flange.shape == (8,)
    assert 0.5 < draws.measurement().pixels.std(0).mean() < 10


def test_noiseless_draw_equals_recording() -> None:
    """The pixels of a draw without noise are those of the simulated recording."""
    draws, settings = make_draws("pixel_px: 0.0", count=2)
    own = draw_cell(settings, 0, 0, None).problem.groups[0].measurement
    np.testing.assert_allclose(draws.measurement().pixels[1], own.pixels, atol=1e-8)


def test_faults_change_pixels() -> None:
    """The share of outliers is the requested one. A scaled board or focal length moves the pixels."""
    exact = make_draws("pixel_px: 0.0")[0].measurement().pixels
    off = np.abs(make_draws("pixel_px: 0.0, outlier_share: 0.1")[0].measurement().pixels - exact).max(-1) > 1e-6
    assert off.mean() == pytest.approx(0.1, abs=0.01)
    for fault in ("board_scale: 1.01", "focal_scale: 1.01"):
        moved = np.linalg.norm(make_draws(f"pixel_px: 0.0, {fault}", 1)[0].measurement().pixels - exact[:1], axis=-1)
        assert 0.3 < moved.mean() < 20


def test_image_noise_grows_from_the_centre() -> None:
    """Image noise is the stated share of the distance from the image centre."""
    draws, _ = make_draws("pixel_px: 0.0, image_noise: 0.01")
    pixels = draws.measurement().pixels
    off = pixels.mean(0) - draws.simulated.cameras["wrist"].center
    ratio = pixels.std(0) / np.abs(off)
    assert np.median(ratio) == pytest.approx(0.01, rel=0.02)


def test_outliers_are_uniform_up_to_their_size() -> None:
    """Outliers are uniform in both directions of both coordinates."""
    exact = make_draws("pixel_px: 0.0", 1)[0].measurement().pixels
    off = make_draws("pixel_px: 0.0, outlier_share: 1.0, outlier_px: 5.0")[0].measurement().pixels - exact
    assert -5 <= off.min() < -4.99
    assert 4.99 < off.max() <= 5
    assert off.std() == pytest.approx(5 / np.sqrt(3), rel=0.01)


def test_focal_scale_enlarges_image_about_centre() -> None:
    """A longer focal length enlarges the image about its centre, and a larger board enlarges its own image."""
    draws, _ = make_draws("pixel_px: 0.0, lens: pinhole", 1)
    exact = draws.measurement().pixels
    centre = draws.simulated.cameras["wrist"].center
    longer, larger = (
        make_draws(f"pixel_px: 0.0, {fault}: 1.01", 1)[0].measurement().pixels
        for fault in ("focal_scale", "board_scale")
    )
    np.testing.assert_allclose(longer - centre, 1.01 * (exact - centre), atol=1e-6)
    spread = np.ptp(larger, axis=2) / np.ptp(exact, axis=2)
    assert np.median(spread) == pytest.approx(1.01, abs=0.002)


def test_robot_errors_have_sigmas_per_axis() -> None:
    """Each stop of each robot has three translations and three rotations with their sigmas.

    Without sigmas there are no errors.
    """
    _, settings = make_draws("robot_sigma_t_m: 1e-4, robot_sigma_r_rad: 2e-3", 1)
    cell = draw_cell(settings, 0, 0, None)
    errors = _robot_errors(cell.problem, settings, np.random.SeedSequence(0), 300)
    assert sorted(errors) == ["eye", "hand"]
    for error in errors.values():
        assert error.shape == (300, 8)
        np.testing.assert_allclose(error.log().std((0, 1)), [1e-4] * 3 + [2e-3] * 3, rtol=0.07)
    exact = {**settings, "robot_sigma_t_m": 0.0, "robot_sigma_r_rad": 0.0}
    assert _robot_errors(cell.problem, exact, np.random.SeedSequence(0), 300) == {}


def test_cells_and_trials_have_separate_seeds() -> None:
    """Another number or another seed of the study is another cell. Another piece has other noise."""
    _, settings = make_draws("pixel_px: 0.2", 1)
    cells = [draw_cell(settings, *each, None) for each in ((0, 0), (0, 1), (1, 0), (0, 0))]
    truths = [cell.simulated.truth[cell.transform].translation for cell in cells]
    assert truths[0].tolist() == truths[3].tolist()
    assert len({tuple(truth) for truth in truths}) == 3
    noisy = [draw(cells[0], settings, seed, 1).measurement().pixels for seed in ((0, 0, 0), (0, 0, 1), (0, 0, 0))]
    assert np.array_equal(noisy[0], noisy[2])
    assert not np.array_equal(noisy[0], noisy[1])
