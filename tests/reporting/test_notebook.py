"""A calibration in a notebook."""

from __future__ import annotations

from dataclasses import replace
from xml.etree.ElementTree import fromstring

from basecal.cell import Calibration, Finding
from basecal.reporting.notebook import html_summary
from export_example import BASE, CALIBRATION, FIXED, POINT


def table_of(html: str) -> dict[str, list[str]]:
    rows = fromstring(f"<html>{html}</html>").findall(".//tr")
    return {row[0].text or "": [cell.text or "" for cell in row[1:]] for row in rows[1:]}


def test_each_transform_is_a_row():
    """With the digits of its sigma; what is fixed has none, and a point no rotation."""
    rows = table_of(html_summary(CALIBRATION))
    assert list(rows) == list(CALIBRATION.transforms)
    assert rows[BASE][:2] == ["812.346, -400.000, 50.000", "0.200, 0.300, 0.500"]
    assert rows[BASE][4] == "free"
    assert rows[FIXED][1] == rows[FIXED][3] == ""
    assert rows[POINT][2:4] == ["", ""]


def test_verdict_and_findings_are_said_as_text():
    """Whatever they hold."""
    html = html_summary(replace(CALIBRATION, findings=(Finding("poor-fit", "warning", (), "<b>x</b> & y"),)))
    assert "<b>GOOD</b>" in html
    assert "<code>poor-fit</code> &lt;b&gt;x&lt;/b&gt; &amp; y" in html


def test_what_is_refused_has_no_table():
    """Only why."""
    assert "<table>" not in html_summary(Calibration("refused"))
