"""Tests of sigmas of image points and arms by marginal likelihood."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from basecal.estimation.scene.adjust import SceneProblem, adjust
from basecal.estimation.scene.sigmas import _Likelihood, estimate_sigmas
from scene_points import ARM_M, ARM_RAD, LENS, PIXEL, made_scene

NOISE = np.repeat([ARM_M, ARM_RAD], 3)


def test_sigmas_of_pixels_and_arm_are_estimated():
    """With 25 views the pixels' sigma is within 5 %.

    The arm's is within a factor of 1.8, because each view has six numbers.
    """
    scene = made_scene(1, count=25)
    noise = np.tile(NOISE, (25, 1))
    fit = adjust(SceneProblem(scene.views, scene.tracks, PIXEL, noise, (LENS,)), scene.truth)
    sigma_px, stop_sigma = estimate_sigmas(fit, (None,))
    assert sigma_px == pytest.approx(PIXEL, rel=0.05)
    assert ARM_RAD / 1.8 < stop_sigma[0, 3] < 1.8 * ARM_RAD


def test_stated_noise_is_kept():
    """A robot keeps its stated sigmas, and the pixels' sigma is estimated."""
    scene = made_scene(2)
    fit = adjust(SceneProblem(scene.views, scene.tracks, 1.0, np.tile(NOISE, (15, 1)), (LENS,)), scene.truth)
    sigma_px, stop_sigma = estimate_sigmas(fit, (NOISE,))
    assert np.array_equal(stop_sigma, np.tile(NOISE, (15, 1)))
    assert sigma_px == pytest.approx(PIXEL, rel=0.1)


@pytest.mark.parametrize("stated", [None, NOISE])
def test_gradient_of_the_likelihood_equals_differences(stated):
    """The gradient by sigmas of pixels and arms agrees with central differences, with stated noise or without."""
    scene = made_scene(2)
    fit = adjust(SceneProblem(scene.views, scene.tracks, PIXEL, np.tile(NOISE, (15, 1)), (LENS,)), scene.truth)
    of = _Likelihood.expand(fit, (stated,))
    logs = np.log([1.3 * PIXEL, *([] if stated is not None else [2 * ARM_M, 0.5 * ARM_RAD])])
    value, gradient = of.negative_log_likelihood(logs)
    steps = 1e-4 * np.eye(len(logs))
    ends = [[of.negative_log_likelihood(logs + sign * h)[0] for sign in (1, -1)] for h in steps]
    np.testing.assert_allclose(gradient, [(after - before) / 2e-4 for after, before in ends], rtol=1e-5, atol=1e-3)
    assert value < max(max(each) for each in ends)


def test_pixel_sigma_may_be_held():
    """With a gross point, the squares would enlarge it. The arm's sigmas are estimated with the given one."""
    scene = made_scene(1, count=25)
    noise = np.tile(NOISE, (25, 1))
    fit = adjust(SceneProblem(scene.views, scene.tracks, PIXEL, noise, (LENS,)), scene.truth)
    _, expected = estimate_sigmas(fit, (None,), holds_pixels=True)
    pixels = fit.tracks.pixels.copy()
    pixels[0] += 1e3
    gross = replace(fit, tracks=replace(fit.tracks, pixels=pixels))
    assert estimate_sigmas(gross, (None,))[0] > 5 * PIXEL
    sigma_px, stop_sigma = estimate_sigmas(gross, (None,), holds_pixels=True)
    assert sigma_px == pytest.approx(fit.sigma_px)
    np.testing.assert_allclose(stop_sigma, expected, rtol=1e-6)
    assert ARM_RAD / 1.8 < stop_sigma[0, 3] < 1.8 * ARM_RAD


@cache
def likelihood(arms=1, stated=(None,)):
    """The likelihood of a scene about its truth, as in `estimate_sigmas`."""
    scene = made_scene(1, arms=arms)
    noise = np.tile(NOISE, (15 * arms, 1))
    fit = adjust(SceneProblem(scene.views, scene.tracks, PIXEL, noise, (LENS,) * arms), scene.truth)
    prior = np.zeros_like(fit.information)
    noises = tuple(None if each is None else NOISE for each in stated)
    return _Likelihood(fit, noises, prior, fit.pixel_gradient, 100.0)


def test_logarithms_of_sigmas_exclude_stated_ones():
    """The pixels' is first, then translation and rotation of each robot without stated noise, for its stops."""
    sigma_px, of_stops = likelihood(2, ("stated", None)).sigmas(np.log([0.5, 2e-4, 3e-3]))
    assert sigma_px == pytest.approx(0.5)
    assert of_stops.shape == (30, 6)
    np.testing.assert_allclose(of_stops[:15], np.tile(NOISE, (15, 1)))
    np.testing.assert_allclose(of_stops[15:], np.tile([2e-4] * 3 + [3e-3] * 3, (15, 1)))


def test_arms_have_a_prior():
    """The prior is 0.3 mrad within a factor of 4, and a translation of reach times that within 5 %."""
    of = likelihood()
    reach_m = of.fit.views.reach_m[0]

    def cost(rad, m):
        """The prior cost of an arm's sigmas."""
        return of._prior_cost(np.log([0.3, m, rad]))[0]

    assert cost(3e-4, 3e-4 * reach_m) == pytest.approx(0.0, abs=1e-12)
    for factor in (4.0, 1 / 4):
        assert cost(3e-4 * factor, 3e-4 * factor * reach_m) == pytest.approx(1.0)
    for factor in (1.05, 1 / 1.05):
        assert cost(3e-4, 3e-4 * reach_m * factor) == pytest.approx(1.0)
    assert cost(3e-4 * 4, 3e-4 * 4 * reach_m * 1.05) == pytest.approx(2.0)
    assert likelihood(1, ("stated",))._prior_cost(np.log([0.3]))[0] == 0.0


def test_likelihood_equals_the_gaussian_formula():
    """The value is -2 log likelihood, compared with determinant and inverse of the whole information."""
    of = likelihood()
    logs = np.log([0.4, 2e-4, 3e-4])
    sigma_px, of_stops = of.sigmas(logs)
    information = of.fit.pixel_information / sigma_px**2
    at = of.fit.columns.errors
    information[at, at] += np.diag(1 / of_stops.ravel() ** 2)
    pull = of.gradient / sigma_px**2
    freedoms = 2 * len(of.fit.tracks) - 3 * of.fit.tracks.count
    expected = (
        freedoms * np.log(sigma_px**2)
        + np.log(of_stops**2).sum()
        + np.linalg.slogdet(information)[1]
        + of.squares / sigma_px**2
        - pull @ np.linalg.solve(information, pull)
        + of._prior_cost(logs)[0]
    )
    assert of.negative_log_likelihood(logs)[0] == pytest.approx(expected, rel=1e-9)
    broken = replace(of, prior=-1e15 * np.eye(len(information)))
    assert broken.negative_log_likelihood(logs)[0] >= 1e12
