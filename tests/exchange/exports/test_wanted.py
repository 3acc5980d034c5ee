"""What an exporter is given."""

from __future__ import annotations

from dataclasses import replace

from basecal.cell import Cell, Robot
from export_example import BASE, wanted


def test_own_frames_are_those_of_the_name():
    """Whatever they are called elsewhere."""
    (one,) = wanted(BASE).transforms
    assert one.own_frames == ("eye_base", "hand_base")
    assert (one.parent, one.child) == ("left base's", "right_base")


def test_a_controller_that_is_not_known_may_be_of_any_kind():
    """One whose format is stated is of that kind alone."""
    robots = {"a": Robot("a", controller={"format": "kuka"}), "b": Robot("b")}
    request = replace(wanted(BASE), cell=Cell("a", robots))
    assert request.may_have_controller("a", "kuka")
    assert not request.may_have_controller("a", "abb")
    assert request.may_have_controller("b", "abb")
    assert request.may_have_controller("c", "abb")
    assert replace(request, cell=None).may_have_controller("a", "abb")
