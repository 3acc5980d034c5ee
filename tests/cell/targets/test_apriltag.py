"""Tests of AprilTags on one body."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from basecal.cell.targets.apriltag import KIND, apriltag_target
from basecal.geometry import SE3

UP = SE3.from_rotvec([0, -np.pi / 2, 0], [1.0, 0.0, 0.0])


def test_tag_corners_start_at_top_left():
    """Ids are 4 tag + corner, ordered by tag number; corners are half a size from the tag's centre."""
    target = apriltag_target("tag36h11", [(7, 0.2, UP), (3, 0.1, SE3.identity())])
    assert target.ids.tolist() == [12, 13, 14, 15, 28, 29, 30, 31]
    np.testing.assert_allclose(target.points[:4], 0.05 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]))
    np.testing.assert_allclose(target.points[5], UP @ np.array([0.1, -0.1, 0.0]))
    np.testing.assert_array_equal(target.tags.numbers, [3, 7])
    np.testing.assert_array_equal(target.tags.corner_ids, [[12, 13, 14, 15], [28, 29, 30, 31]])
    assert [tag["id"] for tag in target.options["tags"]] == [3, 7]


def test_each_tag_is_a_sheet():
    """A sheet has one marker of the tag's size about its centre, with two cells of paper around it."""
    target = apriltag_target("tag36h11", [(3, 0.1, UP)])
    (sheet,) = target.sheets
    (marker,) = sheet.markers
    assert (marker.left, marker.top, marker.size_m, marker.number) == (-0.05, -0.05, 0.1, 3)
    # Six cells of code and two of border: a cell is an eighth.
    np.testing.assert_allclose(sheet.paper, 0.05 * np.array([-1, -1, 1, 1]) * 1.5)
    np.testing.assert_array_equal(sheet.target_from_sheet.matrix, UP.matrix)


POSE = {"t_m": [0, 0, 0], "q_xyzw": [0, 0, 0, 1]}


@pytest.mark.parametrize(
    ("tags", "message"),
    [
        ([{"id": 1, "size_m": 0.1, **POSE}, {"id": 1, "size_m": 0.1, **POSE}], "tag 1 is given twice"),
        ([{"id": 1, "size_m": 0.1, **POSE}, {"id": 2, "size_m": 0.1}], "tag 2 has no pose"),
        ([{"id": 1, "size_m": 0.1, "t_m": [0, 0, 0]}], "exactly one of"),
        ([{"id": -1, "size_m": 0.1}], "greater than or equal to 0"),
        ([{"id": 1, "size_m": 0}], "greater than or equal to 0.000001"),
        ([], "at least 1"),
    ],
)
def test_tags_need_unique_ids_and_poses(tags, message):
    """Each tag number occurs once, and each of several tags needs a pose."""
    with pytest.raises(ValidationError, match=message):
        KIND.entries[0].model_validate({"on": "hand", "kind": "apriltag", "family": "tag36h11", "tags": tags})


def test_single_tag_may_omit_pose():
    """A single tag without a pose is at the target's origin."""
    entry = {"on": "hand", "kind": "apriltag", "family": "tag36h11", "tags": [{"id": 1, "size_m": 0.1}]}
    np.testing.assert_allclose(KIND.entries[0].model_validate(entry).shape().points.mean(0), 0.0, atol=1e-17)


def test_numbered_tag_targets_have_distinct_ids():
    """The tag numbers of the next target continue after the previous target's last; its other fields are equal."""
    tags = [{"id": number, "size_m": 0.1, **POSE} for number in (3, 7)]
    fields = {"kind": "apriltag", "family": "tag36h11", "tags": tags}
    numbers = [[tag["id"] for tag in KIND.numbered_fields(fields, place)["tags"]] for place in range(3)]
    assert numbers == [[3, 7], [8, 12], [13, 17]]
    assert KIND.numbered_fields(fields, 1)["tags"][0] == {**tags[0], "id": 8}
    assert KIND.marks(fields) == {"tag36h11 3", "tag36h11 7"}
