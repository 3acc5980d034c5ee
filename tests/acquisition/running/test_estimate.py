"""Tests of the estimate of a cell during its capture."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.acquisition.running.estimate import MIN_SAMPLES, running_estimate
from basecal.cell import Recording, Sample
from shared.running_samples import BASE, recorded


@pytest.mark.slow
def test_sigma_agrees_with_calibrate():
    """From a warm start it is within 20 % of `calibrate` for the same samples and definition."""
    cell, samples = recorded(14, joints=True)
    before = running_estimate(cell, samples[:-1])
    found = running_estimate(cell, samples, before)
    report = calibrate(cell, Recording(tuple(samples))).transforms[BASE]
    assert found.sigma == pytest.approx(report.sigma_norms, rel=0.2)
    assert found.sigma[0] == pytest.approx(np.sqrt(np.trace(report.covariance[:3, :3])), rel=0.2)


@pytest.mark.journey
def test_warm_and_cold_start_agree():
    """Transform and sigma each differ by less than 10 % of sigma."""
    cell, samples = recorded()
    cold = running_estimate(cell, samples)
    warm = running_estimate(cell, samples, running_estimate(cell, samples[:-1]))
    assert warm.sigma == pytest.approx(cold.sigma, rel=0.1)
    apart = cold.calibration.transforms[BASE].mean.inverse() @ warm.calibration.transforms[BASE].mean
    assert np.linalg.norm(apart.translation) < 0.1 * cold.sigma[0]


def test_fewer_than_four_samples_yield_no_estimate():
    """Only samples in which a target was seen count."""
    cell, samples = recorded(MIN_SAMPLES - 1)
    assert running_estimate(cell, samples) is None
    assert running_estimate(cell, [*samples, Sample(9, robots=samples[0].robots)]) is None
