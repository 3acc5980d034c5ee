"""Listings of FANUC."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.exchange.exporters.fanuc import EXPORTER
from export_example import all_poses, wanted


@pytest.mark.parametrize("name", all_poses())
def test_scipy_gives_the_rotation_back(name):
    """W, P, R about the fixed axes x, y, z in degrees, X, Y, Z in mm."""
    found = re.findall(r"([XYZWPR]) = (\S+) (?:mm|deg)", EXPORTER.text(wanted(name)))
    assert [key for key, _ in found] == list("XYZWPR")
    numbers, (one,) = np.array([float(number) for _, number in found]), wanted(name).transforms
    mean = one.estimate.mean
    np.testing.assert_allclose(numbers[:3] * 1e-3, mean.translation, atol=1e-6)
    np.testing.assert_allclose(
        Rotation.from_euler("xyz", numbers[3:], degrees=True).as_matrix(), mean.rotation, atol=1e-5
    )
