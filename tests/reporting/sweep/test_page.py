"""Tests of the page and the text of a study."""

from __future__ import annotations

import re

from basecal.reporting.sweep.page import _curves, _maps, number, row_texts, sweep_page, sweep_text
from drawings import labels
from sweep_example import HOSTILE, summary


def test_page_has_curves_map_table_and_file() -> None:
    """Two quantities over each axis, a map over both, a row for each point, and the file in its own text."""
    html = sweep_page(summary(), "schema: x  # mine")
    assert html.count("<svg") == 2 * 2 + 1
    assert html.count("<tr>") == 1 + 6
    assert '<pre class="file" tabindex="0">schema: x  # mine</pre>' in html  # the keyboard scrolls it


def test_markup_in_study_is_escaped() -> None:
    """The text of a file creates no element, and no script may run."""
    html = sweep_page(summary(), HOSTILE)
    assert HOSTILE not in html
    assert "script-src &#39;none&#39;" in html or "script-src 'none'" in html


def test_study_page_makes_no_requests() -> None:
    """The page loads no address."""
    assert re.findall(r"(?:src|href|url)\s*[=(]", sweep_page(summary(), "")) == []


def test_study_of_one_point_has_no_figures() -> None:
    """A study of one point has only its row."""
    one = summary(("small",))
    one["axes"] = {}
    one["points"] = [{**one["points"][0], "at": {}}]
    html = sweep_page(one, "")
    assert "<svg" not in html
    assert html.count("<tr>") == 2


def test_every_point_has_a_row() -> None:
    """The values of the axes come first. Missing values are omitted, and reasons are listed once."""
    lines = sweep_text(summary()).splitlines()
    assert lines[0] == "Some study"
    assert lines[1].split()[:2] == ["board", "samples"]
    assert len(lines) == 2 + 6 + 1
    assert "9/10" in lines[2]
    assert "6.10 for 6" in lines[2]
    assert lines[-1] == "no answer: not converged"
    assert "0/10" in lines[7]


def test_row_texts_have_units_and_digits() -> None:
    """Errors and sigmas have two digits, a share is in percent, a time in ms. Missing values are empty."""
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


def test_lines_and_maps_group_points_by_axes() -> None:
    """Each value of the other axis has a line, and one map over both has the medians at their positions."""
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


def test_axis_of_one_value_has_no_figure() -> None:
    one = summary()
    one["axes"] = {**one["axes"], "seed": [1]}
    for point in one["points"]:
        point["at"] = {**point["at"], "seed": 1}
    assert sweep_page(one, "").count("<svg") == 2 * 2 + 1
