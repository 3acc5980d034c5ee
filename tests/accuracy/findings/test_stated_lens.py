"""Tests of the finding `intrinsics`: lenses that differ from their statement."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.findings.prior_contradicted import innovation_covariance
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=18, layout="eye_in_hand", robot_noise=(1e-4, 2e-4), state_robot_noise=False), 1)


def calibrate_with_lens(change):
    """The calibration with changed stated lens parameters that are not assumed exact."""
    wrist = MADE.cell.cameras["wrist"]
    camera = wrist.intrinsics.camera
    lens = replace(wrist.intrinsics, camera=camera.with_parameters(change(camera.parameters)), exact=False)
    return calibrate(replace(MADE.cell, cameras={"wrist": replace(wrist, intrinsics=lens)}), MADE.recording)


@pytest.mark.journey
@pytest.mark.parametrize(("factor", "shift_px", "named"), [
    (1.0, 0.0, None), (1.0, 1.0, None), (1.0, 25.0, "cx by {} px"), (1.02, 0.0, "fx is off by {} %"),
])  # fmt: skip
def test_wrong_lens_is_named_and_answer_holds(factor, shift_px, named):
    """A wrong lens is named with its error, and no transform is wrong.

    A lens as stated, or one pixel off, is not named.
    """
    found = calibrate_with_lens(lambda p: p * np.where(np.arange(9) < 2, factor, 1.0) + shift_px * (np.arange(9) == 2))
    messages = [f.message for f in found.findings if f.code == "intrinsics"]
    assert (found.verdict, len(messages)) == (("good", 0) if named is None else ("doubtful", 1))
    if named is not None:
        number = r"(\S+) ± (\S+)"
        value, sigma = map(float, re.search(named.format(number), messages[0]).groups())
        assert abs(value - (shift_px or 100 * (1 - 1 / factor))) < 3 * sigma
    for name, estimate in found.transforms.items():
        error = (estimate.mean.inverse() @ MADE.truth[name]).log()
        assert np.abs(error / np.sqrt(np.diag(estimate.covariance))).max() < 4


def test_innovation_is_independent_of_wider_priors():
    """The innovation of estimates that the data determine is independent of wider priors.

    Under unit priors it is the uncertainty that the data remove.
    """
    rng = np.random.default_rng(0)
    by_data = rng.standard_normal((3, 9))
    by_data = 1e6 * by_data @ by_data.T
    of_unit = innovation_covariance(np.linalg.inv(by_data + np.eye(3)), np.ones(3))
    np.testing.assert_allclose(of_unit, np.eye(3) - np.linalg.inv(by_data + np.eye(3)), rtol=1e-9)
    wider = np.array([5.0, 2.0, 1.0])
    np.testing.assert_allclose(
        innovation_covariance(np.linalg.inv(by_data + np.diag(wider**-2)), wider), of_unit, atol=1e-5
    )
