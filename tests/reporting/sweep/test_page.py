"""A study as a page."""

from __future__ import annotations

import re

from basecal.reporting.sweep.page import _curves, _maps, number, row_texts, sweep_page, sweep_text
from drawings import labels
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


def test_a_row_has_each_number_in_its_place() -> None:
    """Two digits of errors and sigmas, a share in percent, a time in ms; nothing of what was not computed."""
    point = {
        "solved": 9,
        "trials": 10,
        "error_mm": {"p05": 0.1, "median": 0.25, "p95": 1.55, "rms": 2.0},
        "error_deg": {"p05": 0.01, "median": 0.025, "p95": 0.155, "rms": 0.2},
        "sigma_mm": 0.31,
        "sigma_deg": 0.031,
        "nees": {"mean": 6.123, "expected": 6},
        "coverage": {"share": 0.9512},
        "time_s": 0.01234,
    }
    expected = ["9/10", "0.25", "1.6", "0.31", "0.025", "0.15", "0.031", "6.12 for 6", "95.1%", "12.3"]
    assert row_texts(point) == expected
    bare = {**point, **dict.fromkeys(("error_mm", "error_deg", "sigma_mm", "sigma_deg", "nees", "coverage"))}
    assert row_texts(bare) == ["9/10", *[""] * 8, "12.3"]


def test_lines_and_maps_are_of_points_that_differ_only_there() -> None:
    """A line for each value of the other axis, and one map over both with the medians in their places."""
    made = summary()
    (first, *_), names = _curves(made, "samples")
    assert names == [f"board {value}" for value in made["axes"]["board"]]
    assert first.svg.count('class="line-') == len(names)
    (only,) = _maps(made)
    medians = [point["error_mm"] and point["error_mm"]["median"] for point in made["points"]]
    shown = [label.text for label in labels(only.svg)]
    assert [text for text in shown if text in {"-", *(number(value) for value in medians)}] == [
        "-" if value is None else number(value) for value in medians
    ]


def test_an_axis_of_one_value_has_no_figure() -> None:
    one = summary()
    one["axes"] = {**one["axes"], "seed": [1]}
    for point in one["points"]:
        point["at"] = {**point["at"], "seed": 1}
    assert sweep_page(one, "").count("<svg") == 2 * 2 + 1
