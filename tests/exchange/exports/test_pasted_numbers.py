"""Poses in a controller's numbers, each below a comment."""

from __future__ import annotations

from basecal.exchange.controllers.ur import CONVENTION
from basecal.exchange.exports.pasted_numbers import pasted_numbers
from export_example import BASE, FIXED, wanted


def test_remarks_come_first_then_each_pose_below_its_comment():
    """Comments begin with the mark; the lines are those made of the numbers, to the digits that sigma justifies."""
    exporter = pasted_numbers("numbers", CONVENTION, "%", "in words", lambda numbers: [f"<{' '.join(numbers)}>", "end"])
    lines = exporter.text(wanted(FIXED)).splitlines()
    assert lines[-2:] == ["<0.100000000 0.200000000 0.300000000 0.100000000 0.200000000 0.300000000>", "end"]
    assert lines[-3].startswith(f"% {FIXED}: ")
    assert ", in words; " in lines[-3]
    assert all(line.startswith("% ") for line in lines[:-2])
    assert (exporter.words, exporter.takes, exporter.is_pasted) == ("numbers", ("transform",), True)
    assert f"% {BASE}: " in exporter.text(wanted(BASE))
