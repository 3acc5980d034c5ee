"""Tests of `ArrayCalibration`: transforms under OpenCV's names."""

from __future__ import annotations

import re

import numpy as np
import pytest

from basecal.accuracy.arrays.array_calibration import Alias, ArrayCalibration
from basecal.cell import Calibration, Cell, Finding, Recording, Robot
from basecal.errors import FrameNotFound, NotObservable
from basecal.geometry import SE3, PoseEstimate

ESTIMATE = PoseEstimate(SE3.exp([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]), np.diag([1e-6] * 6))
FOUND = ArrayCalibration(
    Calibration("doubtful", {"a_from_b": ESTIMATE}, findings=(Finding("x", "error", (), "The arm never rotates."),)),
    Cell("eye", {"eye": Robot("eye")}),
    Recording(),
    {"b2a": Alias("a_from_b"), "a2b": Alias("a_from_b", True), "c2a": Alias("a_from_c")},
)


def test_names_give_means_and_inverses() -> None:
    """Each name gives a mean in OpenCV's shape, and inverses have their covariance."""
    np.testing.assert_allclose(FOUND.R_b2a, ESTIMATE.mean.rotation)
    assert FOUND.t_a2b.shape == (3, 1)
    np.testing.assert_allclose(FOUND["a2b"].covariance, ESTIMATE.inverse().covariance)
    assert {"R_a2b", "t_b2a"} <= set(dir(FOUND))


def test_missing_transform_states_reason() -> None:
    """A missing transform raises with the reason; an unknown name lists the available ones."""
    with pytest.raises(NotObservable, match="c2a was not found: The arm never rotates"):
        _ = FOUND["c2a"]
    with pytest.raises(FrameNotFound, match="b2a, a2b, c2a"):
        _ = FOUND["d2a"]
    with pytest.raises(AttributeError, match="R_d2a"):
        _ = FOUND.R_d2a
    assert not hasattr(FOUND, "R_c2a")
    with pytest.raises(NotObservable, match="c2a was not found"):
        _ = FOUND.t_c2a
    assert {"R_c2a", "t_c2a"}.isdisjoint(dir(FOUND))
    assert repr(FOUND).startswith("<doubtful: b2a [122.2, 172.8, 307.8] ± [1, 1, 1] mm")


def test_notebook_table_shows_array_names() -> None:
    """The notebook table shows the array names with their own values; an inverse has its own."""
    table = FOUND._repr_html_()
    assert re.findall(r"<tr><td>(\w+)</td>", table) == ["b2a", "a2b"]
    for name in ("b2a", "a2b"):
        x, y, z = 1e3 * FOUND[name].mean.translation
        assert f"<td>{name}</td><td>{x:.1f}, {y:.1f}, {z:.1f}</td>" in table
