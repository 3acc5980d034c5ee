"""Corners of AprilTags in bags."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg
from tests.bag_of_cell import BEGIN_S, KINDS, Kind, Wrote, new_bag

from basecal.cell import PixelObservation
from basecal.cell.files import cell_from_dict
from basecal.cell.format.yaml_text import parse_yaml
from basecal.cell.target import Tags
from basecal.errors import InputError
from basecal.exchange.bags.bag import open_bag
from basecal.exchange.bags.choice import choose_sources
from basecal.exchange.bags.rows import make_rows, stream_instants
from basecal.exchange.bags.sources import Asked
from basecal.exchange.bags.survey import survey_bag
from basecal.exchange.bags.tags import DEFINITIONS, TAGS, tag_corners
from basecal.exchange.bags.tracks import read_tracks
from basecal.geometry import SE3

# As an image shows a tag that is upright for OpenCV: top left, top right, bottom right, bottom left.
SQUARE = np.array([[10.0, 20.0], [50.0, 20.0], [50.0, 60.0], [10.0, 60.0]])
CELL = """\
schema: basecal/cell/1
reference: arm
robots: {arm: {}}
cameras:
  wrist: {on: arm, size_px: [640, 480], intrinsics: {status: free}}
targets:
  board: {on: world, kind: aprilgrid, tags: [2, 1], tag_m: 0.04, spacing: 0.3, family: tag36h11}
"""


def detection(tag: int, corners: np.ndarray, family: str = "tag36h11") -> SimpleNamespace:
    """What the detector says of a tag: it begins top right, goes on against the clock, and counts from the border."""
    points = [SimpleNamespace(x=x + 0.5, y=y + 0.5) for x, y in corners[[1, 0, 3, 2]]]
    return SimpleNamespace(id=tag, corners=points, family=family)


def array(*found: SimpleNamespace) -> SimpleNamespace:
    return SimpleNamespace(detections=list(found))


TAGS_OF_BOARD = Tags("tag36h11", np.array([0, 1, 3]), np.array([[3, 2, 1, 0], [7, 6, 5, 4], [15, 14, 13, 12]]))


def test_corners_have_the_ids_of_the_target() -> None:
    """They are taken as OpenCV goes round a tag, and counted from the centre of the first pixel; strangers are left."""
    stranger, other = detection(9, SQUARE), detection(0, SQUARE, "tag25h9")
    seen = tag_corners(array(detection(3, SQUARE), stranger, other, detection(1, SQUARE + 100)), TAGS_OF_BOARD)
    assert seen is not None
    np.testing.assert_array_equal(seen.ids, [15, 14, 13, 12, 7, 6, 5, 4])
    np.testing.assert_allclose(seen.pixels, np.vstack([SQUARE, SQUARE + 100]))


@pytest.mark.parametrize(
    "found",
    [
        array(),
        array(detection(9, SQUARE)),
        array(detection(1, SQUARE), detection(1, SQUARE)),
        array(detection(1, SQUARE * np.nan)),
    ],
)
def test_what_is_no_tag_of_the_target(found: SimpleNamespace) -> None:
    """No tag, a stranger, one tag twice, and corners that are no numbers."""
    assert tag_corners(found, TAGS_OF_BOARD) is None


def add_tags(bag: Wrote, time: float, *found: SimpleNamespace) -> None:
    point = bag.store.types["apriltag_msgs/msg/Point"]
    made = [
        bag.make("apriltag_msgs/msg/AprilTagDetection", "tag36h11", each.id, 0, 0.0, 50.0, point(0.0, 0.0),
                 [point(corner.x, corner.y) for corner in each.corners], np.eye(3).ravel())
        for each in found
    ]  # fmt: skip
    bag.add("/detections", TAGS, time, bag.make(TAGS, bag.header(time), made))


def written(folder: Path, kind: Kind) -> Path:
    """A bag in which an arm stands at two places, and a board is seen at each."""
    bag = new_bag(folder, kind)
    for name, text in DEFINITIONS.items():
        bag.store.register(get_types_from_msg(text, name))
    for k in range(60):
        time = BEGIN_S + k / 20
        bag.pose("/arm/pose", time, SE3(np.eye(3), np.array([0.1 * (k >= 30), 0.0, 0.5])))
        add_tags(bag, time, *([] if k % 2 else [detection(0, SQUARE + k), detection(1, SQUARE + 60)]))
    return bag.close()


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_of_detections_gives_rows(kind: Kind, tmp_path: Path) -> None:
    """Each image in which a tag was found is a row with its corners by the ids of the target."""
    cell = cell_from_dict(parse_yaml(CELL, "cell.yaml").data)
    asked = Asked(robots={"arm": "/arm/pose"}, views={("wrist", "board"): "/detections"})
    with open_bag(written(tmp_path, kind)) as bag:
        survey = survey_bag(bag)
        taken = choose_sources(bag, survey, asked, cell)
        tracks = read_tracks(bag, survey, taken)
        rows = list(make_rows(tracks, stream_instants(tracks, bag.path), {}))
        with pytest.raises(InputError, match=r"'none' must be in cell\.yaml, with tag sizes; there is board"):
            choose_sources(bag, survey, Asked(asked.robots, views={("wrist", "none"): "/detections"}), cell)
    views = [view for row in rows for view in row.observations]
    assert len(views) == 30
    assert isinstance(views[2], PixelObservation)
    upright = [1, 0, 3, 2]  # of a tag of Kalibr's, whose images OpenCV's are turned against by half a turn
    by_id = dict(zip(views[2].ids.tolist(), views[2].pixels.tolist(), strict=True))
    np.testing.assert_allclose([by_id[k] for k in upright], SQUARE + 4)
    np.testing.assert_allclose([by_id[4 + k] for k in upright], SQUARE + 60)
