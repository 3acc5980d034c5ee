"""What the benchmarks tell: pages and figures made of their results."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

from benchmarks.common import RESULTS
from benchmarks.figure import Panel, svg
from benchmarks.peers.tables import brief
from benchmarks.report import PAGE, page

ROOT = Path(__file__).parents[1]
SVG = "{http://www.w3.org/2000/svg}"


def test_page_is_made_of_the_results() -> None:
    """docs/benchmarks.md is what `python -m benchmarks.report` makes of benchmarks/results: no number is typed."""
    assert PAGE.read_text(encoding="utf-8") == page()


def test_readme_takes_the_peers_from_the_results() -> None:
    """The README's table beside today's practice is made of benchmarks/results/peers.json."""
    rows = json.loads((RESULTS / "peers.json").read_text(encoding="utf-8"))["rows"]
    assert brief(rows) in (ROOT / "README.md").read_text(encoding="utf-8")


def test_figure_puts_points_where_they_are() -> None:
    """Decades are evenly spaced along both axes, and larger values stand further right and up."""
    panel = Panel("a < b", "x [m]", "y [s]", {"line": [(1, 10), (10, 100), (100, 1000)]})
    circles = list(ElementTree.fromstring(svg([panel])).iter(f"{SVG}circle"))
    (x0, y0), (x1, y1), (x2, y2) = ((float(c.attrib["cx"]), float(c.attrib["cy"])) for c in circles)
    assert abs(x2 - 2 * x1 + x0) <= 0.2
    assert abs(y2 - 2 * y1 + y0) <= 0.2
    assert x2 > x1 > x0
    assert y2 < y1 < y0
