"""Tests of the export of a CSV table."""

from __future__ import annotations

import csv
from io import StringIO

import numpy as np
import pytest

from basecal.exchange.exporters.csv import export_text
from basecal.geometry import SE3
from export_example import all_poses, wanted


@pytest.mark.parametrize("name", all_poses())
def test_csv_keeps_all_digits(name):
    """All values are read back by column names, also for frames with commas and quotes."""
    (one,) = wanted(name).transforms
    (row,) = csv.DictReader(StringIO(export_text(wanted(name))))
    numbers = {key: float(row[key]) for key in row if key[:1] in "xyzqs" and key != "status"}
    read = SE3.from_quaternion([numbers[f"q{i}"] for i in "xyzw"], [numbers[f"{i}_m"] for i in "xyz"])
    np.testing.assert_allclose(read.matrix, one.estimate.mean.matrix, atol=1e-15)
    np.testing.assert_array_equal([numbers[f"sigma_{i}_m"] for i in "xyz"], one.estimate.sigma_t)
    np.testing.assert_array_equal([numbers[f"sigma_r{i}_rad"] for i in "xyz"], one.estimate.sigma_r)
    assert (row["name"], row["parent"], row["child"], row["status"]) == (name, one.parent, one.child, one.status)
