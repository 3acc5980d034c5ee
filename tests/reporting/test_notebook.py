"""Tests of the HTML summary of a calibration in a notebook."""

from __future__ import annotations

from dataclasses import replace
from xml.etree.ElementTree import fromstring

import pytest

from basecal.cell import Calibration, Finding, Tolerance
from basecal.reporting.notebook import html_summary
from export_example import BASE, CALIBRATION, FIXED, POINT


def table_of(html: str) -> dict[str, list[str]]:
    rows = fromstring(f"<html>{html}</html>").findall(".//tr")
    return {row[0].text or "": [cell.text or "" for cell in row[1:]] for row in rows[1:]}


def test_each_transform_has_a_row():
    """Each transform has a row, rounded by its sigma. A fixed transform has no sigmas, and a point no rotation."""
    rows = table_of(html_summary(CALIBRATION))
    assert list(rows) == list(CALIBRATION.transforms)
    assert rows[BASE][:2] == ["812.35, -400.00, 50.00", "0.20, 0.30, 0.50"]
    assert rows[BASE][4] == "free"
    assert rows[FIXED][1] == rows[FIXED][3] == ""
    assert rows[POINT][2:4] == ["", ""]


def test_verdict_and_findings_are_escaped():
    """The verdict and the messages of findings are shown as text, even if they contain markup."""
    html = html_summary(replace(CALIBRATION, findings=(Finding("poor-fit", "warning", (), "<b>x</b> & y"),)))
    assert ">GOOD</b>" in html
    assert "<code>poor-fit</code> &lt;b&gt;x&lt;/b&gt; &amp; y" in html


@pytest.mark.parametrize(("expected_m", "word"), [(2e-4, "PASS"), (2e-3, "FAIL")])
def test_tolerance_verdict_comes_first(expected_m: float, word: str) -> None:
    """PASS or FAIL, with the expected error beside it, precedes the table and replaces the verdict."""
    html = html_summary(replace(CALIBRATION, tolerance=Tolerance(1e-3, expected_m, word == "PASS")))
    assert html.index(f">{word}</b> expected error {1e3 * expected_m:.2g}") < html.index("<table>")
    assert "GOOD" not in html


def test_refused_calibration_has_no_table():
    """A refused calibration has only its reason, no table."""
    assert "<table>" not in html_summary(Calibration("refused"))
