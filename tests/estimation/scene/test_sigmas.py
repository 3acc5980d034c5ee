"""Sigmas of image points and of arms by the marginal likelihood."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.scene.adjust import Task, adjust
from basecal.estimation.scene.sigmas import _Likelihood, estimate_sigmas
from scene_points import ARM_M, ARM_RAD, LENS, PIXEL, made_scene

NOISE = np.repeat([ARM_M, ARM_RAD], 3)


def test_sigmas_of_pixels_and_arm_are_found():
    """Of 25 views the pixels' within 5 %, the arm's within a factor of 1.8, which its six numbers a view tell."""
    scene = made_scene(1, count=25)
    noise = np.tile(NOISE, (25, 1))
    fit = adjust(Task(scene.views, scene.tracks, PIXEL, noise, (LENS,)), scene.truth)
    sigma_px, stop_sigma = estimate_sigmas(fit, (None,))
    assert sigma_px == pytest.approx(PIXEL, rel=0.05)
    assert ARM_RAD / 1.8 < stop_sigma[0, 3] < 1.8 * ARM_RAD


def test_stated_noise_stays():
    """The sigmas of a robot that states them are these, and pixels' are found beside."""
    scene = made_scene(2)
    fit = adjust(Task(scene.views, scene.tracks, 1.0, np.tile(NOISE, (15, 1)), (LENS,)), scene.truth)
    sigma_px, stop_sigma = estimate_sigmas(fit, (NOISE,))
    assert np.array_equal(stop_sigma, np.tile(NOISE, (15, 1)))
    assert sigma_px == pytest.approx(PIXEL, rel=0.1)


@pytest.mark.parametrize("stated", [None, NOISE])
def test_gradient_of_the_likelihood(stated):
    """It agrees with central differences, of pixels and of arms, stated or not."""
    scene = made_scene(2)
    fit = adjust(Task(scene.views, scene.tracks, PIXEL, np.tile(NOISE, (15, 1)), (LENS,)), scene.truth)
    likelihood = _Likelihood.expand(fit, (stated,))
    logs = np.log([1.3 * PIXEL, *([] if stated is not None else [2 * ARM_M, 0.5 * ARM_RAD])])
    value, gradient = likelihood.negative_log_likelihood(logs)
    steps = 1e-4 * np.eye(len(logs))
    ends = [[likelihood.negative_log_likelihood(logs + sign * h)[0] for sign in (1, -1)] for h in steps]
    np.testing.assert_allclose(gradient, [(after - before) / 2e-4 for after, before in ends], rtol=1e-5, atol=1e-3)
    assert value < max(max(each) for each in ends)


def test_the_sigma_of_pixels_may_be_held():
    """With a gross point, the squares of all would make it large; the arm's sigmas are found beside the given one."""
    scene = made_scene(1, count=25)
    noise = np.tile(NOISE, (25, 1))
    fit = adjust(Task(scene.views, scene.tracks, PIXEL, noise, (LENS,)), scene.truth)
    _, expected = estimate_sigmas(fit, (None,), holds_pixels=True)
    pixels = fit.tracks.pixels.copy()
    pixels[0] += 1e3
    gross = replace(fit, tracks=replace(fit.tracks, pixels=pixels))
    assert estimate_sigmas(gross, (None,))[0] > 5 * PIXEL
    sigma_px, stop_sigma = estimate_sigmas(gross, (None,), holds_pixels=True)
    assert sigma_px == pytest.approx(fit.sigma_px)
    np.testing.assert_allclose(stop_sigma, expected, rtol=1e-6)
    assert ARM_RAD / 1.8 < stop_sigma[0, 3] < 1.8 * ARM_RAD
