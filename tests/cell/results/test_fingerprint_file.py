"""Tests of the file of scene points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.cell.fingerprint import Fingerprint
from basecal.cell.results.fingerprint_file import FILE, read_fingerprint, write_fingerprint
from basecal.errors import DatasetError


def test_fingerprint_round_trip(tmp_path: Path) -> None:
    """Points are read back to the last bit with their descriptors; a run without the file has none."""
    assert read_fingerprint(tmp_path) is None
    rng = np.random.default_rng(0)
    kept = Fingerprint(rng.standard_normal((7, 3)), rng.integers(0, 256, (7, 128)).astype(np.uint8))
    write_fingerprint(kept, tmp_path, tmp_path)
    found = read_fingerprint(tmp_path)
    assert found is not None
    np.testing.assert_array_equal(found.points, kept.points)
    np.testing.assert_array_equal(found.descriptors, kept.descriptors)


@pytest.mark.parametrize("damage", [lambda data: data[:-1], lambda data: b"\xff" * len(data)])
def test_damaged_fingerprint_is_refused(tmp_path: Path, damage) -> None:
    """Missing bytes and non-finite numbers are errors."""
    write_fingerprint(Fingerprint(np.zeros((3, 3)), np.zeros((3, 128), dtype=np.uint8)), tmp_path, tmp_path)
    (tmp_path / FILE).write_bytes(damage((tmp_path / FILE).read_bytes()))
    with pytest.raises(DatasetError, match="calibrate again"):
        read_fingerprint(tmp_path)
