"""A calibration without some samples is that of a recording without them."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.residuals.without_samples import without_samples
from basecal.accuracy.verdict import calibrate
from basecal.cell import Recording
from basecal.errors import InputError
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"


@pytest.fixture(scope="module")
def made():
    cell = simulate(Scenario(samples=15, robot_noise=(1e-4, 2e-4)), 4)
    return cell, calibrate(cell.cell, cell.recording)


def test_it_is_that_of_the_others(made):
    """As `solve` finds it from the recording without these samples, which no residual is of."""
    cell, calibration = made
    found = without_samples(cell.cell, cell.recording, calibration, {3, 7})
    few = Recording(tuple(s for s in cell.recording.samples if s.sample not in {3, 7}))
    alone = solve(cell.cell, few).transforms[BASE]
    assert found.converged
    assert np.abs((found.transforms[BASE].mean.inverse() @ alone.mean).log()).max() < 1e-7
    np.testing.assert_allclose(found.transforms[BASE].covariance, alone.covariance, rtol=1e-4, atol=1e-14)
    assert {each.sample for each in found.residuals.per_sample} == set(range(15)) - {3, 7}


def test_too_few_are_told(made):
    """Without any sample an error; with one, what is not seen is not given."""
    cell, calibration = made
    with pytest.raises(InputError, match="no sample is left"):
        without_samples(cell.cell, cell.recording, calibration, set(range(15)))
    assert BASE not in without_samples(cell.cell, cell.recording, calibration, set(range(1, 15))).transforms


def test_noise_that_was_estimated_is_that_of_the_calibration():
    """Nobody stated any: the answer without some samples goes by the sigmas that all of them told."""
    made = simulate(Scenario(samples=14, robot_noise=(3e-4, 5e-4), state_robot_noise=False), 2)
    calibration = calibrate(made.cell, made.recording)
    found = without_samples(made.cell, made.recording, calibration, {5})
    before, after = (np.sqrt(np.diag(of.covariance)) for of in (calibration[BASE], found.transforms[BASE]))
    assert np.all(np.abs(np.log(after / before)) < 0.4)
