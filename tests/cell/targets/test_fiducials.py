"""Tests of marker dictionaries and tag families."""

from __future__ import annotations

import cv2
import pytest

from basecal.cell.targets.fiducials import DICTIONARIES, FAMILIES, cell_count, series_name, smallest_dictionary


@pytest.mark.parametrize("name", DICTIONARIES)
def test_dictionaries_match_opencv(name):
    """Each name is one of OpenCV's, with the same number of cells across."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    assert cell_count(name) == dictionary.markerSize


def test_family_cell_counts_follow_codes():
    """The cell count is the integer square root of the bits in the family's name."""
    assert [cell_count(name) for name in FAMILIES] == [4, 5, 6, 6, 4, 7, 6, 6, 7]
    assert len(set(DICTIONARIES)) == len(DICTIONARIES) == 27


@pytest.mark.parametrize(
    ("name", "count", "larger"),
    [
        ("DICT_4X4_50", 50, "DICT_4X4_50"),
        ("DICT_4X4_50", 51, "DICT_4X4_100"),
        ("DICT_5X5_100", 7, "DICT_5X5_100"),
        ("DICT_6X6_250", 251, "DICT_6X6_1000"),
        ("DICT_4X4_50", 1001, "DICT_4X4_50"),
        ("DICT_APRILTAG_25h9", 40, "DICT_APRILTAG_25h9"),
    ],
)
def test_smallest_sufficient_dictionary(name, count, larger):
    """The larger dictionary begins with the same markers; if none is large enough the named one is kept."""
    assert smallest_dictionary(name, count) == larger
    assert series_name(larger) == series_name(name)
