"""What the local page draws."""

from __future__ import annotations

import xml.etree.ElementTree as tree

import numpy as np

from basecal.acquisition.coverage import COVERAGE_GRID, Coverage
from basecal.acquisition.watching import Sigma
from basecal.reporting.live.drawings import coverage_drawing, marks, sigma_drawing


def test_a_part_of_the_picture_is_a_square():
    """As many full ones as parts in which something was seen, and the share in words."""
    cells = np.zeros(COVERAGE_GRID, dtype=bool)
    cells[1, :3] = True
    root = tree.fromstring(coverage_drawing(Coverage(cells, {})))
    fills = [rect.get("fill") for rect in root.iter("rect")]
    assert len(fills) == cells.size
    assert fills.count(fills[6]) == 3
    assert root.find("title").text == "12 % of the picture is covered"


def test_a_line_falls_with_the_sigma():
    """It goes down as the sigma does, from the left to the right, and its ends are told."""
    drawn = tree.fromstring(sigma_drawing([Sigma(k, 2e-3 / k, 1e-3) for k in range(1, 6)]))
    points = [tuple(map(float, pair.split())) for pair in drawn.find("path").get("d").lstrip("M").split("L")]
    assert points == sorted(points)
    assert [v for _, v in points] == sorted(v for _, v in points)
    assert [word.text for word in drawn.iter("text")] == ["2 mm", "0.4 mm", "1", "5"]


def test_one_sigma_is_no_line():
    """Nothing is drawn before there are two."""
    assert sigma_drawing([Sigma(1, 1e-3, 1e-3)]) == ""


def test_marks_stand_at_their_points():
    """A cross each."""
    assert tree.fromstring(marks(np.array([[10.0, 20.0], [3.0, 4.0]]))).get("d").count("M") == 4
    assert marks(np.zeros((0, 2))) == ""
