"""The estimate of a cell while it is captured."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.acquisition.running.estimate import MIN_SAMPLES, running_estimate
from basecal.cell import Recording, Sample
from shared.running_samples import BASE, recorded


@pytest.mark.slow
def test_sigma_is_that_of_the_report():
    """From a warm start it is within 20 % of what `calibrate` prints for the same samples, in the same definition."""
    cell, samples = recorded(14, joints=True)
    before = running_estimate(cell, samples[:-1])
    found = running_estimate(cell, samples, before)
    report = calibrate(cell, Recording(tuple(samples))).transforms[BASE]
    assert found.sigma == pytest.approx(report.sigma_norms, rel=0.2)
    assert found.sigma[0] == pytest.approx(np.sqrt(np.trace(report.covariance[:3, :3])), rel=0.2)


def test_a_warm_start_ends_where_a_cold_one_does():
    """The transform differs by less than a tenth of its sigma, and the sigma by less than a tenth."""
    cell, samples = recorded()
    cold = running_estimate(cell, samples)
    warm = running_estimate(cell, samples, running_estimate(cell, samples[:-1]))
    assert warm.sigma == pytest.approx(cold.sigma, rel=0.1)
    apart = cold.calibration.transforms[BASE].mean.inverse() @ warm.calibration.transforms[BASE].mean
    assert np.linalg.norm(apart.translation) < 0.1 * cold.sigma[0]


def test_few_samples_are_not_estimated():
    """Fewer than four samples in which a target was seen give no estimate, whatever else there is."""
    cell, samples = recorded(MIN_SAMPLES - 1)
    assert running_estimate(cell, samples) is None
    assert running_estimate(cell, [*samples, Sample(9, robots=samples[0].robots)]) is None
