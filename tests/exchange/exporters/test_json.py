"""JSON."""

from __future__ import annotations

import json

import numpy as np
import pytest

from basecal.exchange.exporters.json import export_text
from basecal.geometry import SE3
from export_example import BASE, all_poses, wanted


@pytest.mark.parametrize("name", all_poses())
def test_all_digits_come_back(name):
    """Place, quaternion, matrix and covariance."""
    (one,) = wanted(name).transforms
    data = json.loads(export_text(wanted(name)))["transforms"][name]
    np.testing.assert_allclose(
        SE3.from_quaternion(data["q_xyzw"], data["t_m"]).matrix, one.estimate.mean.matrix, atol=1e-15
    )
    np.testing.assert_array_equal(data["matrix"], one.estimate.mean.matrix)
    np.testing.assert_array_equal(data["covariance"], one.estimate.covariance)


def test_frames_and_verdict_are_said():
    """By their names elsewhere."""
    data = json.loads(export_text(wanted(BASE)))
    assert data["verdict"] == "good"
    assert data["transforms"][BASE]["parent"] == "left base's"
    assert data["transforms"][BASE]["status"] == "free"
