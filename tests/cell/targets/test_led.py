"""Tests of LED targets."""

from __future__ import annotations

import pytest

from basecal.cell.targets.led import KIND, led_target


def test_single_led_is_at_origin():
    """Without points, an LED target has one point at the origin and is detected as an LED."""
    light = led_target()
    assert light.points.tolist() == [[0, 0, 0]]
    assert light.is_point
    assert light.found_by == "led"
    assert light.options == {"points_m": [[0.0, 0.0, 0.0]]}


@pytest.mark.parametrize(
    ("points", "entry"), [(None, 0), ([[1, 2, 3]], 0), ([[0, 0, 0], [1, 2, 3]], 1), ("rubbish", 0)]
)
def test_led_entry_by_point_count(points, entry):
    """A single LED has the mount of a point, several have that of a body."""
    fields = {} if points is None else {"points_m": points}
    assert KIND.entry_index(fields) == entry
    if points != "rubbish":
        read = KIND.entries[entry].model_validate({"on": "hand", "kind": "led", **fields})
        assert len(read.shape().points) == len(points or [0])
