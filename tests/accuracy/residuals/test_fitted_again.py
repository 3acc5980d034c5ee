"""What is fitted again, and what cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.residuals.fitted_again import fitted_again
from basecal.accuracy.verdict import calibrate
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
