"""A fleet as a page."""

from __future__ import annotations

from pathlib import Path

from basecal.reporting.fleet.page import fleet_page
from basecal.studies.fleet.run import Fleet
from basecal.studies.fleet.summary import summarise_fleet
from fleet_example import ROWS


def test_the_page_holds_every_cell_escaped() -> None:
    """The worst first, its findings counted; names of folders are no HTML."""
    page = fleet_page(summarise_fleet(Fleet(Path(), (), Path()), ROWS), ROWS)
    assert "<td>drift</td><td>2</td>" in page
    assert "&lt;c&gt;" in page
    assert "<c>" not in page
    assert "<gossip>" not in page
    assert page.index("it moved, too") < page.index("it moved <small>")
    assert "default-src &#39;none&#39;" in page or "default-src 'none'" in page


def test_a_row_shows_its_status_and_leads_to_its_answer() -> None:
    """Where there is one; the whole sentence is there, and the worst status has its colour above."""
    rows = [*ROWS, {**ROWS[1], "cell": "line 1/e", "said": "Let `basecal fix CELL` do so. " + "x" * 300}]
    page = fleet_page(summarise_fleet(Fleet(Path(), (), Path()), rows), rows)
    assert '<header class="verdict unreadable">' in page
    assert "4 of 5" in page
    assert '<a href="cells/line%201/e/report.html">line 1/e</a>' in page
    assert page.count("/report.html") == 4
    assert "x" * 300 in page
    assert "Let <code>basecal fix CELL</code> do so." in page
    assert page.count('<tr class="doubtful">') == 3
