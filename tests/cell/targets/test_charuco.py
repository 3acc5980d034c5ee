"""Tests of ChArUco boards in OpenCV's layout."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from pydantic import ValidationError

from basecal.cell.targets.charuco import KIND, charuco_target

ENTRY = {
    "on": "hand",
    "kind": "charuco",
    "squares": [5, 4],
    "square_m": 0.04,
    "marker_m": 0.03,
    "dictionary": "DICT_4X4_50",
}


@pytest.mark.parametrize("squares", [(5, 4), (6, 5), (4, 4)])
@pytest.mark.parametrize("legacy", [False, True])
def test_corners_and_markers_match_opencv(squares, legacy):
    """Corner ids and positions, and marker positions, equal OpenCV's for the new and the legacy pattern."""
    ours = charuco_target(squares, 0.04, 0.03, "DICT_4X4_50", legacy)
    theirs = cv2.aruco.CharucoBoard(squares, 0.04, 0.03, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    theirs.setLegacyPattern(legacy)
    np.testing.assert_allclose(ours.points, theirs.getChessboardCorners(), atol=1e-7)
    corners = np.array(theirs.getObjPoints())
    (sheet,) = ours.sheets
    assert [m.number for m in sheet.markers] == theirs.getIds().ravel().tolist()
    np.testing.assert_allclose([(m.left, m.top) for m in sheet.markers], corners[:, 0, :2], atol=1e-7)
    assert {m.size_m for m in sheet.markers} == {0.03}
    side = 0.04 * np.array(squares)
    np.testing.assert_allclose(sheet.paper, [-0.02, -0.02, *(side + 0.02)])
    covered = np.sum((sheet.rectangles[:, 2:] - sheet.rectangles[:, :2]).prod(1)) + 0.04**2 * len(sheet.markers)
    assert covered == pytest.approx(side.prod())


def test_marker_is_smaller_than_square():
    """A marker as large as its square is refused, one just below is accepted."""
    with pytest.raises(ValidationError, match=r"marker_m 0\.04 is not below square_m 0\.04"):
        KIND.entries[0].model_validate({**ENTRY, "marker_m": 0.04})
    assert KIND.entries[0].model_validate({**ENTRY, "marker_m": 0.0399}).shape().options["marker_m"] == 0.0399


def test_unknown_dictionary_is_refused():
    """The error for a dictionary unknown to OpenCV suggests the nearest name."""
    with pytest.raises(ValidationError, match="did you mean 'DICT_4X4_50'"):
        KIND.entries[0].model_validate({**ENTRY, "dictionary": "DICT_4X4_5O"})


def test_entries_use_new_pattern_by_default():
    """A board entry has the legacy pattern only on request."""
    assert KIND.entries[0].model_validate(ENTRY).shape().options["legacy_pattern"] is False
    assert KIND.entries[0].model_validate({**ENTRY, "legacy_pattern": True}).shape().options["legacy_pattern"] is True


def test_numbered_boards_share_no_marker():
    """Further boards use other dictionaries, each large enough for the white squares: 60 for 11 x 11."""
    fields = {**ENTRY, "squares": [11, 11]}
    names = [KIND.numbered_fields(fields, place)["dictionary"] for place in range(4)]
    assert names == ["DICT_4X4_50", "DICT_5X5_100", "DICT_6X6_100", "DICT_7X7_100"]
    assert KIND.numbered_fields({**ENTRY, "dictionary": "DICT_5X5_250"}, 1)["dictionary"] == "DICT_4X4_50"
    assert [KIND.numbered_fields({**ENTRY, "squares": [10, 10]}, place)["dictionary"] for place in (1, 2)] == [
        "DICT_5X5_50",
        "DICT_6X6_50",
    ]


def test_charuco_target_uses_new_pattern_by_default():
    """`charuco_target` uses the new pattern by default, too."""
    assert charuco_target((4, 4), 0.04, 0.03, "DICT_4X4_50").options["legacy_pattern"] is False
