"""Tests of the export of 4x4 text."""

from __future__ import annotations

from io import StringIO

import numpy as np
import pytest

from basecal.exchange.controller_poses import read_poses
from basecal.exchange.exporters.matrix import EXPORTER
from export_example import FIXED, all_poses, wanted


@pytest.mark.parametrize("name", all_poses())
def test_numpy_reads_exported_matrix(name):
    """NumPy skips the comments and reads the rows."""
    (one,) = wanted(name).transforms
    read = np.loadtxt(StringIO(EXPORTER.text(wanted(name))))
    np.testing.assert_allclose(read, one.estimate.mean.matrix, atol=1e-6)


def test_fixed_transform_is_exact():
    """A fixed transform is written to 1e-9."""
    (one,) = wanted(FIXED).transforms
    np.testing.assert_allclose(np.loadtxt(StringIO(EXPORTER.text(wanted(FIXED)))), one.estimate.mean.matrix, atol=1e-9)


def test_exported_matrix_is_imported_again(tmp_path):
    """The own import reads a stream of one pose."""
    (tmp_path / "a.txt").write_text(EXPORTER.text(wanted()))
    (one,) = wanted().transforms
    np.testing.assert_allclose(read_poses(tmp_path / "a.txt", "m").poses[0].matrix, one.estimate.mean.matrix, atol=1e-6)
