"""Points of a scene by which a cell is recognised."""

from __future__ import annotations

import numpy as np

from basecal.cell.fingerprint import Fingerprint


def test_it_is_as_long_as_its_points() -> None:
    """Five points make five."""
    assert len(Fingerprint(np.zeros((5, 3)), np.zeros((5, 128), dtype=np.uint8))) == 5
