"""What an exporter is given."""

from __future__ import annotations

from export_example import BASE, wanted


def test_own_frames_are_those_of_the_name():
    """Whatever they are called elsewhere."""
    (one,) = wanted(BASE).transforms
    assert one.own_frames == ("eye_base", "hand_base")
    assert (one.parent, one.child) == ("left base's", "right_base")
