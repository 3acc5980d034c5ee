"""Priors that the data contradict are told; true ones are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.findings.prior_contradicted import contradicted_priors
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

TOLD = Scenario(samples=12, target="points", camera_mount="prior", target_mount="prior", base="prior")
MOUNT = "eye_flange_from_wrist"


@pytest.mark.parametrize("intrinsics", ["fixed", "prior"])
def test_true_priors_are_not_contradicted(intrinsics):
    """Over ten cells whose priors were drawn as stated no finding is made: by chance once in 250 such tests."""
    for seed in range(10):
        s = simulate(replace(TOLD, intrinsics=intrinsics), seed)
        assert contradicted_priors(solve(s.cell, s.recording)) == []


def test_a_wrong_prior_is_named():
    """A mount stated eight sigmas off is contradicted, by name, and the verdict is doubtful."""
    s = simulate(TOLD, 0)
    (camera,) = s.cell.cameras.values()
    off = SE3.exp(np.array([8 * camera.mount.sigma[0], 0, 0, 0, 0, 0]))
    mount = replace(camera.mount, mean=s.truth[MOUNT] @ off)
    cell = replace(s.cell, cameras={camera.name: replace(camera, mount=mount)})
    calibration = calibrate(cell, s.recording)
    told = [f for f in calibration.findings if f.code == "prior-contradicted"]
    assert [f.about for f in told] == [(MOUNT,)]
    assert told[0].do[-1] == "`basecal fix CELL` makes it free."
    assert calibration.verdict == "doubtful"


def test_a_prior_of_which_the_data_say_nothing_is_not_judged():
    """With a still eye, its mount's prior and the base stand for each other: the prior is all there is to know."""
    s = simulate(replace(TOLD, arms="eye_still", base="free", target_mount="fixed"), 0)
    (camera,) = s.cell.cameras.values()
    mount = replace(camera.mount, mean=camera.mount.mean @ SE3.exp(np.array([0.1, 0, 0, 0, 0, 0])))
    cell = replace(s.cell, cameras={camera.name: replace(camera, mount=mount)})
    assert contradicted_priors(solve(cell, s.recording)) == []
