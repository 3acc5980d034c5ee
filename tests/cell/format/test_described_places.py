"""Places with descriptors in bytes."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.format.described_places import DESCRIPTOR_LENGTH, points_from_bytes, points_to_bytes, row_bytes


@pytest.mark.parametrize("count", [0, 1, 7])
def test_what_is_written_is_read(count: int) -> None:
    """To the last bit, and none of none."""
    rng = np.random.default_rng(1)
    places, levels = rng.standard_normal((count, 3)), rng.integers(0, 256, (count, DESCRIPTOR_LENGTH)).astype(np.uint8)
    data = points_to_bytes(places, levels)
    found = points_from_bytes(data, 3)
    assert len(data) == count * row_bytes(3)
    assert found is not None
    np.testing.assert_array_equal(found[0], places)
    np.testing.assert_array_equal(found[1], levels)


def test_other_files_are_none() -> None:
    """Of a length that is no whole number of rows, or with a place that is no number."""
    data = points_to_bytes(np.zeros((2, 2)), np.zeros((2, DESCRIPTOR_LENGTH), dtype=np.uint8))
    assert points_from_bytes(data[:-1], 2) is None
    assert points_from_bytes(np.full(2, np.nan).tobytes() + data[16:], 2) is None
