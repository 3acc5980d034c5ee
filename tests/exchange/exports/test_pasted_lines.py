"""Transforms as lines to paste, each below a comment."""

from __future__ import annotations

from basecal.exchange.exports.pasted_lines import pasted_lines
from export_example import BASE, FIXED, wanted


def test_remarks_come_first_then_each_transform_below_its_comment():
    """Comments begin with the mark; the lines are those made of the transform and of the request."""
    exporter = pasted_lines("numbers", "%", "in words", lambda one, request: [one.name, request.calibration.verdict])
    lines = exporter.text(wanted(FIXED)).splitlines()
    assert lines[-2:] == [FIXED, "good"]
    assert lines[-3].startswith(f"% {FIXED}: ")
    assert ", in words; " in lines[-3]
    assert all(line.startswith("% ") for line in lines[:-2])
    assert (exporter.words, exporter.takes, exporter.is_pasted) == ("numbers", ("transform",), True)
    assert f"% {BASE}: " in exporter.text(wanted(BASE))
