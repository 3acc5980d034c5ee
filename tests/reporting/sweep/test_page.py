"""A study as a page."""

from __future__ import annotations

import re

from basecal.reporting.sweep.page import sweep_page, sweep_text
from sweep_example import HOSTILE, summary


def test_page_has_curves_map_table_and_file() -> None:
    """Two quantities over each axis, a map over both, a row for each point, the file as it is written."""
    html = sweep_page(summary(), "schema: x  # mine")
    assert html.count("<svg") == 2 * 2 + 1
    assert html.count("<tr>") == 1 + 6
    assert '<pre class="file" tabindex="0">schema: x  # mine</pre>' in html  # the keyboard scrolls it


def test_hostile_words_stay_words() -> None:
    """Nothing that a file says becomes an element, and nothing may run."""
    html = sweep_page(summary(), HOSTILE)
    assert HOSTILE not in html
    assert "script-src &#39;none&#39;" in html or "script-src 'none'" in html


def test_page_asks_nothing_of_any_server() -> None:
    """No address in it is loaded."""
    assert re.findall(r"(?:src|href|url)\s*[=(]", sweep_page(summary(), "")) == []


def test_a_study_of_one_point_has_no_figures() -> None:
    """But its row."""
    one = summary(("small",))
    one["axes"] = {}
    one["points"] = [{**one["points"][0], "at": {}}]
    html = sweep_page(one, "")
    assert "<svg" not in html
    assert html.count("<tr>") == 2


def test_every_point_has_its_row() -> None:
    """With the axes' values first; what was not computed is left out, and reasons are said once."""
    lines = sweep_text(summary()).splitlines()
    assert lines[0] == "Some study"
    assert lines[1].split()[:2] == ["board", "samples"]
    assert len(lines) == 2 + 6 + 1
    assert "9/10" in lines[2]
    assert "6.10 for 6" in lines[2]
    assert lines[-1] == "no answer: not converged"
    assert "0/10" in lines[7]
