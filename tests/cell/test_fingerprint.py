"""Tests of the scene points that identify a cell."""

from __future__ import annotations

import numpy as np

from basecal.cell.fingerprint import Fingerprint


def test_fingerprint_length_is_point_count() -> None:
    """The length of a fingerprint is its number of points."""
    assert len(Fingerprint(np.zeros((5, 3)), np.zeros((5, 128), dtype=np.uint8))) == 5
