"""Tests of the page and the text of a fleet."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from basecal.reporting.fleet.page import COLUMN_TITLES, fleet_page, fleet_text, row_texts, sort_by_verdict
from basecal.studies.fleet.run import Fleet
from basecal.studies.fleet.summary import summarise_fleet
from fleet_example import ROWS

SUMMARY = summarise_fleet(Fleet(Path(), (), Path()), ROWS)


def test_fleet_page_lists_cells_escaped() -> None:
    """The worst cells come first and findings are counted. Names of folders are escaped."""
    page = fleet_page(summarise_fleet(Fleet(Path(), (), Path()), ROWS), ROWS)
    assert "<td>drift</td><td>2</td>" in page
    assert "&lt;c&gt;" in page
    assert "<c>" not in page
    assert "<gossip>" not in page
    assert page.index("it moved, too") < page.index("it moved <small>")
    assert "default-src &#39;none&#39;" in page or "default-src 'none'" in page


def test_row_has_status_and_link_to_report() -> None:
    """A row links to its report if there is one and has the whole message. The worst status colours the banner."""
    rows = [*ROWS, {**ROWS[1], "cell": "line 1/e", "said": "Let `basecal fix CELL` do so. " + "x" * 300}]
    page = fleet_page(summarise_fleet(Fleet(Path(), (), Path()), rows), rows)
    assert '<header class="verdict unreadable">' in page
    assert "4 of 5" in page
    assert '<a href="cells/line%201/e/report.html">line 1/e</a>' in page
    assert page.count("/report.html") == 4
    assert "x" * 300 in page
    assert "Let <code>basecal fix CELL</code> do so." in page
    assert page.count('<tr class="doubtful">') == 3


@pytest.mark.parametrize(
    ("rows", "heading"),
    [
        (ROWS[:1], "0 of 1 cell need attention"),
        (ROWS[1:2], "1 of 1 cell needs attention"),
        (ROWS[:2], "1 of 2 cells needs attention"),
        (ROWS, "3 of 4 cells need attention"),
    ],
)
def test_the_heading_counts_the_cells_that_need_attention(rows: list[dict[str, Any]], heading: str) -> None:
    """Singular and plural."""
    page = fleet_page(summarise_fleet(Fleet(Path(), (), Path()), rows), rows)
    assert f"<title>{heading}</title>" in page


def test_cells_are_sorted_by_verdict() -> None:
    """Cells are sorted by verdict, then by decreasing uncertainty."""
    assert [row["cell"] for row in sort_by_verdict(ROWS)] == ["<c>", "d", "b", "a"]


def test_fleet_text_counts_verdicts() -> None:
    """The text has the count of each verdict, and lists each cell that is not good."""
    lines = fleet_text(SUMMARY, ROWS).splitlines()
    assert lines[0] == "4 cells: 1 good, 2 doubtful, 1 unreadable"
    assert "median 1.5 mm" in lines[1]
    assert lines[2:] == [
        "<c>: unreadable, cell.yaml:1: <gossip>",
        "d: doubtful, it moved, too",
        "b: doubtful, it moved",
    ]
    many = [{**ROWS[1], "cell": f"c{k}", "said": "x" * 200} for k in range(30)]
    lines = fleet_text({**SUMMARY, "cells": 30}, many).splitlines()
    assert lines[-1] == "and 10 more"
    assert max(map(len, lines)) < 130


def test_rows_match_column_titles() -> None:
    """Each column has a text, which is empty if the value is unknown."""
    assert all(len(row_texts(row)) == len(COLUMN_TITLES) for row in ROWS)
    assert row_texts(ROWS[2])[:4] == ["<c>", "unreadable", "cell.yaml:1: <gossip>", ""]


@pytest.mark.parametrize(("waiting", "end"), [(20, "c19: doubtful, it moved"), (21, "and 1 more")])
def test_at_most_twenty_cells_are_listed(waiting: int, end: str) -> None:
    """Good cells are not listed, and an unknown spread has no line."""
    rows = [ROWS[0], *({**ROWS[1], "cell": f"c{k:02}"} for k in range(waiting))]
    lines = fleet_text({**SUMMARY, "sigma_mm": None}, rows).splitlines()
    assert lines[-1] == end
    assert len(lines) == 1 + 20 + (waiting > 20)
    assert "95 %" in fleet_text(SUMMARY, rows)


def test_row_numbers_have_two_digits() -> None:
    """Counts are integers."""
    texts = dict(zip(COLUMN_TITLES, row_texts({**ROWS[0], "sigma_mm": 0.456, "samples": 1234}), strict=True))
    assert (texts["sigma mm"], texts["samples"], texts["time s"], texts["held out mm"]) == ("0.46", "1234", "2.0", "")
