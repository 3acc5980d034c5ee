"""Tests of spots fitted to patches of an image."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import ndtr

from basecal.geometry import Array
from basecal.vision.fit import spot_fit
from basecal.vision.fit.spot_fit import _Linearisation, _variance, _variance_factor, fit_spot

SIZE = 21


def spot(x: float, y: float, wide: float, high: float, brightness: float) -> Array:
    """Levels of a Gaussian over the pixels' squares, (21, 21)."""
    along = (np.diff(ndtr((np.arange(SIZE + 1) - 0.5 - at) / width)) for at, width in ((x, wide), (y, high)))
    across, down = along
    return brightness * np.outer(down, across)


def test_noiseless_spot_is_fitted_exactly() -> None:
    """A noiseless spot is recovered, including its two widths and its brightness."""
    found = fit_spot(spot(9.7, 10.4, 1.3, 1.8, 3000.0) + 12.0, np.ones((SIZE, SIZE), bool), (10, 10, 1.0))
    assert found is not None
    assert (found.x, found.y) == (pytest.approx(9.7, abs=1e-6), pytest.approx(10.4, abs=1e-6))
    assert (found.width_x, found.width_y) == (pytest.approx(1.3, abs=1e-5), pytest.approx(1.8, abs=1e-5))
    assert found.brightness == pytest.approx(3000, rel=1e-5)


def test_unusable_pixels_have_no_effect() -> None:
    """Unusable pixels have no effect, whatever their levels."""
    levels, usable = spot(9.7, 10.4, 1.5, 1.5, 3000.0) + 12.0, np.ones((SIZE, SIZE), bool)
    usable[9:12, 9:12] = False
    levels[~usable] = 255.0
    found = fit_spot(levels, usable, (10, 10, 1.5))
    assert found is not None
    assert (found.x, found.y) == (pytest.approx(9.7, abs=1e-3), pytest.approx(10.4, abs=1e-3))


@pytest.mark.journey
def test_spot_errors_match_sigmas() -> None:
    """Errors agree with their sigmas under shot and read noise."""
    rng, ratio = np.random.default_rng(0), []
    for _ in range(150):
        x, y = rng.uniform(9.5, 10.5, 2)
        levels = rng.poisson(10 * (spot(x, y, 1.4, 1.4, 800.0) + 8)) / 10 + rng.standard_normal((SIZE, SIZE))
        found = fit_spot(levels, np.ones((SIZE, SIZE), bool), (10, 10, 1.2))
        assert found is not None
        ratio += [(found.x - x) / found.sigma_px, (found.y - y) / found.sigma_px]
    # The rms of 300 coordinates has a sigma of 4 %.
    assert np.sqrt(np.mean(np.square(ratio))) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("log_width", [4.9, 5.1])
def test_extreme_width_is_no_spot(monkeypatch: pytest.MonkeyPatch, log_width: float) -> None:
    """A width beyond 148 px, or below a 148th, is no spot, and no exponential of it is computed."""
    levels = spot(10, 10, 1.5, 1.5, 3000.0)
    end = np.array([[10.0, 10.0, log_width, 0.4, 3000.0, 12.0]])
    monkeypatch.setattr(spot_fit, "levenberg_marquardt", lambda *_: SimpleNamespace(state=end))
    monkeypatch.setattr(spot_fit, "_WEIGHTED_ROUNDS", 0)
    assert (fit_spot(levels, np.ones((SIZE, SIZE), bool), (10, 10, 1.5)) is not None) == (log_width < 5)


def test_too_few_pixels_give_no_spot() -> None:
    """Six unknowns require more than eleven pixels."""
    usable = np.zeros((SIZE, SIZE), bool)
    usable[10, 5:16] = True
    assert fit_spot(spot(10, 10, 1.5, 1.5, 3000.0), usable, (10, 10, 1.5)) is None


def noisy(floor: float, slope: float) -> tuple[_Linearisation, Array]:
    """A spot whose squared residuals are exactly linear in its level, and weights of its pixels."""
    level = spot(9.7, 10.4, 1.5, 1.5, 3000.0).ravel()
    signs = np.where(np.arange(level.size) % 2, 1.0, -1.0)
    return _Linearisation(level, signs * np.sqrt(floor + slope * level), np.zeros((6, level.size))), np.ones(level.size)


@pytest.mark.parametrize(("floor", "slope"), [(1.0, 0.0), (4.0, 0.25), (0.5, 3.0)])
def test_variance_is_linear_in_the_level(floor: float, slope: float) -> None:
    """The variance of read and shot noise is estimated from all usable pixels; others have no effect."""
    at, weights = noisy(floor, slope)
    np.testing.assert_allclose(_variance(at, weights, np.zeros((6, 6))), floor + slope * at.level, rtol=1e-9)
    weights[5::7] = 0.0
    at.residuals[5::7] = 1e3
    np.testing.assert_allclose(_variance(at, weights, np.zeros((6, 6))), floor + slope * at.level, rtol=1e-9)


def test_variance_is_at_least_that_of_rounding() -> None:
    """Exact levels have the variance of rounding to integers. Noise that is lower in the spot has no slope."""
    at, weights = noisy(0.0, 0.0)
    np.testing.assert_allclose(_variance(at, weights, np.zeros((6, 6))), 1 / 12)
    falling = at._replace(residuals=np.where(at.level > 1, 0.5, 2.0) * np.where(np.arange(441) % 2, 1.0, -1.0))
    found = _variance(falling, weights, np.zeros((6, 6)))
    assert np.ptp(found) == 0
    assert found[0] > 1


def test_residuals_are_corrected_by_leverage() -> None:
    """The squared residual of a pixel that determines half of a parameter is half of its variance."""
    at, weights = noisy(1.0, 0.0)
    half = at._replace(jacobian=np.pad(np.full((1, 441), 0.5), ((0, 5), (0, 0))))
    np.testing.assert_allclose(_variance(half, weights, 2 * np.eye(6)), 2.0, rtol=1e-9)
    np.testing.assert_allclose(_variance(half, weights, 4 * np.eye(6)), 20.0, rtol=1e-9)


def test_variance_factor_follows_students_t() -> None:
    """Ten equal pixels have a factor of 10 / 8 by Student's t; it is at most two."""
    at, weights = noisy(1.0, 0.0)
    for count, factor in ((10, 10 / 8), (3, 2.0), (100, 100 / 98)):
        jacobian = np.zeros((6, 441))
        jacobian[0, :count] = 3.0
        jacobian[1, :count] = 4.0
        assert _variance_factor(at._replace(jacobian=jacobian), weights) == pytest.approx(factor)
    for axis in (0, 1):
        jacobian = np.zeros((6, 441))
        jacobian[axis, :20] = np.repeat([1.0, 2.0], 10)  # equivalent to 50^2 / 170 equal pixels
        assert _variance_factor(at._replace(jacobian=jacobian), weights) == pytest.approx(2500 / (2500 - 2 * 170))


def test_spot_is_fitted_to_twelve_pixels() -> None:
    """Twelve pixels that show its brightness and height suffice for a spot."""
    usable = np.zeros((SIZE, SIZE), bool)
    usable[9:12, 8:12] = True
    found = fit_spot(spot(9.7, 10.4, 1.3, 1.3, 3000.0) + 12.0, usable, (9.7, 10.4, 1.3))
    assert found is not None
    assert (found.x, found.y) == (pytest.approx(9.7, abs=0.01), pytest.approx(10.4, abs=0.01))
