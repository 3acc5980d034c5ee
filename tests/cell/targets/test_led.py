"""Lights."""

from __future__ import annotations

import pytest

from basecal.cell.targets.led import KIND, led_target


def test_one_light_is_at_the_origin():
    """Without points there is one; it is found as a light."""
    light = led_target()
    assert light.points.tolist() == [[0, 0, 0]]
    assert light.is_point
    assert light.found_by == "led"
    assert light.options == {"points_m": [[0.0, 0.0, 0.0]]}


@pytest.mark.parametrize(
    ("points", "entry"), [(None, 0), ([[1, 2, 3]], 0), ([[0, 0, 0], [1, 2, 3]], 1), ("rubbish", 0)]
)
def test_one_or_several(points, entry):
    """A single light has the mount of a point, several have that of a body."""
    fields = {} if points is None else {"points_m": points}
    assert KIND.entry_index(fields) == entry
    if points != "rubbish":
        read = KIND.entries[entry].model_validate({"on": "hand", "kind": "led", **fields})
        assert len(read.shape().points) == len(points or [0])
