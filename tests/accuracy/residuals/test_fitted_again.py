"""What is fitted again, and what cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.residuals.fitted_again import fitted_again
from basecal.accuracy.verdict import calibrate
from basecal.estimation.noise.target_shape import shape_of
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=10, robot_noise=(2e-4, 4e-4)), 1)


def test_views_without_their_transforms_are_left_out():
    """A calibration that lacks a mount has no view of what it carries."""
    calibration = calibrate(MADE.cell, MADE.recording)
    assert len(fitted_again(MADE.cell, MADE.recording, calibration).problem.groups) == 1
    lacking = replace(calibration, transforms={})
    assert fitted_again(MADE.cell, MADE.recording, lacking).problem.groups == ()


def test_errors_of_stops_are_found():
    """Where robots have noise, their errors at the optimum are of the order of one sigma, not zero."""
    fitted = fitted_again(MADE.cell, MADE.recording, calibrate(MADE.cell, MADE.recording))
    assert 0.1 < np.sqrt(np.mean(fitted.state.stop_errors**2)) < 1.5


def test_targets_have_the_shapes_that_were_found():
    """Points are moved by the coefficients that the calibration holds; those of a target of other points are not."""
    calibration = calibrate(MADE.cell, MADE.recording)
    (stated,) = fitted_again(MADE.cell, MADE.recording, calibration).problem.groups
    points = stated.measurement.points_in_target
    for shape, moved in (([3.0, 0.0, -2.0], True), ([1.0, 2.0], False)):
        noise = {**calibration.noise, "targets": {"board": {"shape": shape}}}
        (found,) = fitted_again(MADE.cell, MADE.recording, replace(calibration, noise=noise)).problem.groups
        expected = points + shape_of(points) @ np.array(shape) if moved else points
        np.testing.assert_allclose(found.measurement.points_in_target, expected, atol=1e-15)
        assert moved == bool(np.abs(expected - points).max() > 1e-4)


def test_a_light_has_no_shape():
    """Nothing is divided by its size, which is none."""
    light = simulate(Scenario(samples=12, target="led", camera_mount="fixed", target_mount="fixed"), 1)
    calibration = calibrate(light.cell, light.recording)
    with np.errstate(all="raise"):
        assert len(fitted_again(light.cell, light.recording, calibration).problem.groups) == 1
