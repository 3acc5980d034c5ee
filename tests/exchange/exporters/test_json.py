"""Tests of the export of JSON."""

from __future__ import annotations

import json

import numpy as np
import pytest

from basecal.exchange.exporters.json import export_text
from basecal.geometry import SE3
from export_example import BASE, all_poses, wanted


@pytest.mark.parametrize("name", all_poses())
def test_json_keeps_all_digits(name):
    """Position, quaternion, matrix and covariance are read back."""
    (one,) = wanted(name).transforms
    data = json.loads(export_text(wanted(name)))["transforms"][name]
    np.testing.assert_allclose(
        SE3.from_quaternion(data["q_xyzw"], data["t_m"]).matrix, one.estimate.mean.matrix, atol=1e-15
    )
    np.testing.assert_array_equal(data["matrix"], one.estimate.mean.matrix)
    np.testing.assert_array_equal(data["covariance"], one.estimate.covariance)


def test_json_states_frames_and_verdict():
    """Frames have their names of the other program."""
    data = json.loads(export_text(wanted(BASE)))
    assert data["verdict"] == "good"
    assert data["transforms"][BASE]["parent"] == "left base's"
    assert data["transforms"][BASE]["status"] == "free"
