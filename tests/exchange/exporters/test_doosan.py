"""DRL."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.exchange.exporters.doosan import EXPORTER
from export_example import all_poses, wanted


@pytest.mark.parametrize("name", all_poses())
def test_scipy_gives_the_rotation_back(name):
    """About z, the new y, the new z, in degrees; mm stand first."""
    (found,) = re.findall(r"^posx\((.+)\)$", EXPORTER.text(wanted(name)), re.MULTILINE)
    numbers, (one,) = np.array([float(number) for number in found.split(",")]), wanted(name).transforms
    mean = one.estimate.mean
    np.testing.assert_allclose(numbers[:3] * 1e-3, mean.translation, atol=1e-6)
    turned = Rotation.from_euler("ZYZ", numbers[3:], degrees=True).as_matrix()
    np.testing.assert_allclose(turned, mean.rotation, atol=1e-5)
