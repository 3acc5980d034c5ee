"""Names of dictionaries and families."""

from __future__ import annotations

import cv2
import pytest

from basecal.cell.targets.fiducials import DICTIONARIES, FAMILIES, cell_count, series_name, smallest_dictionary


@pytest.mark.parametrize("name", DICTIONARIES)
def test_dictionaries_are_opencvs_and_as_wide(name):
    """Each name is one of OpenCV's, with so many cells across as OpenCV has."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    assert cell_count(name) == dictionary.markerSize


def test_families_have_the_cells_of_their_codes():
    """The square root of the bits that the name says, without what is left."""
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
def test_a_dictionary_that_is_large_enough(name, count, larger):
    """It begins with the same markers; where there is none it is the one that was named."""
    assert smallest_dictionary(name, count) == larger
    assert series_name(larger) == series_name(name)
