"""Tests of the study of the paper as text and as figures."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest

from basecal.reporting.study_text import chart_file, paper_text, shift_length_figures

LEVELS = {"1%": 1.0, "5%": 5.0}
SVG = "{http://www.w3.org/2000/svg}"
SERIES = {"a < b": [(0.01, 5.0), (0.1, 0.5), (1.0, 0.05)], "c": [(0.01, 4.9), (1.0, 0.051)]}


def transform(number):
    return {"R": [[number + row + 0.1 * k for k in range(3)] for row in range(3)], "t": [number, -number, 0.5]}


def row(shift_m):
    keys = ("closed_form", "maximum_likelihood", "bound")
    numbers = {f"{key}_{unit}": (1 + k) * shift_m for k, key in enumerate(keys) for unit in ("deg", "mm")}
    return {"shift_m": shift_m, **numbers}


STUDY = {
    "settings": {"draws": 123, "sigma_px": 0.25},
    "noiseless": {"camera_from_led": transform(1), "eye_base_from_hand_base": transform(2)},
    "table1_camera_from_led": {
        level: {
            **transform(3 + n),
            "paper_quantile": {"rotation": 0.25, "translation": 0.75},
            "t_sd": [0.011, 0.022, 0.033],
        }
        for level, n in LEVELS.items()
    },
    "table2_orthonormalised": {level: transform(10 + n)["R"] for level, n in LEVELS.items()},
    "table3_eye_base_from_hand_base": {level: transform(20 + n) for level, n in LEVELS.items()},
    "orders_of_orthonormalising": {
        level: {"translation_error_before": n, "translation_error_after": 2 * n, "rotations_differ_by": 3e-16}
        for level, n in LEVELS.items()
    },
    "shift_length": [row(0.1), row(0.4)],
    "paper": {
        "noiseless": {"camera_from_led": transform(31), "eye_base_from_hand_base": transform(32)},
        "table1_camera_from_led": {level: transform(33 + n) for level, n in LEVELS.items()},
        "table2_orthonormalised": {level: transform(40 + n)["R"] for level, n in LEVELS.items()},
        "table3_eye_base_from_hand_base": {level: transform(50 + n) for level, n in LEVELS.items()},
        "known_slips_of_the_paper": ["a sign", "a column"],
    },
}
BLOCKS = {block.splitlines()[0].split(" (")[0]: block.splitlines() for block in paper_text(STUDY).split("\n\n")}


def numbers(line):
    return [float(word) for word in re.findall(r"-?\d+\.\d+", line)]


@pytest.mark.parametrize(
    ("title", "theirs", "ours"),
    [
        ("noiseless camera_from_led: the paper, ours", 31, 1),
        ("noiseless eye_base_from_hand_base: the paper, ours", 32, 2),
        ("table 3, 5%, from table 2 by eq.", 55, 25),
    ],
)
def test_results_of_the_paper_are_left_of_ours(title, theirs, ours):
    """Each table has the numbers of the paper on the left and ours on the right.

    The rows of the rotations come first, then the translations, with four decimals.
    """
    _, *rows, last = BLOCKS[title]
    expected = [[*a, *b] for a, b in zip(transform(theirs)["R"], transform(ours)["R"], strict=True)]
    assert [numbers(line) for line in rows] == [pytest.approx(each) for each in expected]
    assert numbers(last) == pytest.approx([*transform(theirs)["t"], *transform(ours)["t"]])


def test_table_compares_single_draw_with_many():
    """Table 1 states the standard deviation of our draws.

    It also states the share of them that is nearer the truth than the paper's single draw.
    """
    block = BLOCKS["table 1, 1% noise"]
    assert "ours: mean of 123 draws" in block[0]
    assert numbers(block[1])[:3] == pytest.approx(transform(34)["R"][0])
    assert numbers(block[-2]) == [0.011, 0.022, 0.033]
    assert block[-1].endswith("rotation 25%, translation 75%")


def test_text_lists_orders_lengths_and_slips():
    """The text states errors before and after orthonormalisation.

    It has one line per shift length, and one line per slip of the paper.
    """
    orders = next(lines for title, lines in BLOCKS.items() if title.startswith("error of the base's"))
    assert orders[2] == "  5%: 5.0000 before, 10.0000 after; rotations differ by 3e-16"
    lengths = next(lines for title, lines in BLOCKS.items() if title.startswith("rms error of one"))
    assert numbers(lengths[1]) == pytest.approx([0.1, 0.1, 0.2, 0.3, 0.1, 0.2, 0.3])
    assert BLOCKS["errors of the paper:"] == ["errors of the paper:", "  - a sign", "  - a column"]


def test_figures_have_one_line_per_method():
    """The figures show the errors of rotation in deg and of translation in mm, with the pixel noise in the title."""
    figures = shift_length_figures(STUDY)
    assert figures.keys() == {"shift_length_rotation.svg", "shift_length_translation.svg"}
    for what, unit in (("rotation", "deg"), ("translation", "mm")):
        drawn = figures[f"shift_length_{what}.svg"]
        assert f"Error of {what} of one station, 0.25 px" in drawn
        assert f"[{unit}]" in drawn
        assert all(name in drawn for name in ("closed form", "maximum likelihood", "Cramer-Rao bound"))


def chart(series=SERIES):
    return ElementTree.fromstring(chart_file("errors & lengths", "length [m]", "error [deg]", series))


def markers(drawing):
    return [(float(c.get("cx")), float(c.get("cy"))) for c in drawing.iter(f"{SVG}circle")]


def test_markers_lie_inside_the_axes():
    """Every marker is within the axes."""
    found = markers(chart())
    assert len(found) == 5
    assert all(62 <= x <= 626 and 12 <= y <= 248 for x, y in found)


def test_decades_are_evenly_spaced():
    """On a logarithmic axis 0.01, 0.1 and 1 have equal distances."""
    (x0, _), (x1, _), (x2, _), *_ = markers(chart())
    assert abs((x1 - x0) - (x2 - x1)) < 0.11


def test_chart_has_legend_and_axis_labels():
    """The names of the lines are below one another, each in the colour of its line.

    The labels of both axes are above the chart.
    """
    drawing = chart()
    names = {t.text: t for t in drawing.iter(f"{SVG}text") if t.get("class", "").startswith("line-")}
    assert list(names) == ["\u25cf a < b", "\u25cf c"]
    first, second = (float(t.get("y")) for t in names.values())
    assert second - first >= 16
    assert [g.get("class") for g in drawing.iter(f"{SVG}g")] == ["line-0", "line-1"]
    assert "error [deg] over length [m]" in [t.text for t in drawing.iter(f"{SVG}text")]


def test_axes_increase_to_the_right_and_upwards():
    """Points of a line of slope one are evenly spaced along both axes, larger values further right and up."""
    (x0, y0), (x1, y1), (x2, y2) = markers(chart({"a": [(1.0, 10.0), (10.0, 100.0), (100.0, 1000.0)]}))
    assert abs(x2 - 2 * x1 + x0) <= 0.2
    assert abs(y2 - 2 * y1 + y0) <= 0.2
    assert x2 > x1 > x0
    assert y2 < y1 < y0
