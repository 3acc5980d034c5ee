"""Names of dictionaries and families."""

from __future__ import annotations

import cv2
import pytest

from basecal.cell.targets.fiducials import DICTIONARIES, FAMILIES, cells_across


@pytest.mark.parametrize("name", DICTIONARIES)
def test_dictionaries_are_opencvs_and_as_wide(name):
    """Each name is one of OpenCV's, with so many cells across as OpenCV has."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    assert cells_across(name) == dictionary.markerSize


def test_families_have_the_cells_of_their_codes():
    """The square root of the bits that the name says, without what is left."""
    assert [cells_across(name) for name in FAMILIES] == [4, 5, 6, 6, 4, 7, 6, 6, 7]
    assert len(set(DICTIONARIES)) == len(DICTIONARIES) == 27
