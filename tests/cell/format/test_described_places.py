"""Tests of points with descriptors stored as bytes."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.format.described_places import DESCRIPTOR_LENGTH, points_from_bytes, points_to_bytes, row_bytes


@pytest.mark.parametrize("count", [0, 1, 7])
def test_points_and_descriptors_round_trip(count: int) -> None:
    """Points and descriptors are read back to the last bit, also if there are none."""
    rng = np.random.default_rng(1)
    places, levels = rng.standard_normal((count, 3)), rng.integers(0, 256, (count, DESCRIPTOR_LENGTH)).astype(np.uint8)
    data = points_to_bytes(places, levels)
    found = points_from_bytes(data, 3)
    assert len(data) == count * row_bytes(3)
    assert found is not None
    np.testing.assert_array_equal(found[0], places)
    np.testing.assert_array_equal(found[1], levels)


def test_malformed_bytes_give_none() -> None:
    """Bytes that are not a whole number of rows, or with a point that is not finite, give None."""
    data = points_to_bytes(np.zeros((2, 2)), np.zeros((2, DESCRIPTOR_LENGTH), dtype=np.uint8))
    assert points_from_bytes(data[:-1], 2) is None
    assert points_from_bytes(np.full(2, np.nan).tobytes() + data[16:], 2) is None
