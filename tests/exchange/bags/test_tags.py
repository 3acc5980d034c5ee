"""Tests of AprilTag corners in bags."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg
from tests.bag_of_cell import BEGIN_S, KINDS, BagWriter, Kind, new_bag

from basecal.cell import Cell, PixelObservation, PoseObservation
from basecal.cell.files import cell_from_dict
from basecal.cell.format.yaml_text import parse_yaml
from basecal.cell.target import Tags
from basecal.errors import InputError
from basecal.exchange.bags.bag import open_bag
from basecal.exchange.bags.choice import choose_sources
from basecal.exchange.bags.rows import make_rows, stream_instants
from basecal.exchange.bags.sources import BagRequest
from basecal.exchange.bags.survey import survey_bag
from basecal.exchange.bags.tags import (
    DEFINITIONS,
    PACKAGES,
    TAG_POSES,
    TAGS,
    frames_of_tags,
    tag_corners,
)
from basecal.exchange.bags.tracks import read_tracks
from basecal.geometry import SE3

# Corners of an upright tag in an image by OpenCV: top left, top right, bottom right, bottom left.
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
TAG_CELL = """\
schema: basecal/cell/1
reference: arm
robots: {arm: {}}
cameras:
  wrist: {on: arm, size_px: [640, 480], intrinsics: {status: free}}
targets:
  cube:
    on: world
    kind: apriltag
    family: tag36h11
    tags:
    - {id: 3, size_m: 0.08, t_m: [0, 0, 0], q_xyzw: [0, 0, 0, 1]}
    - {id: 7, size_m: 0.04, t_m: [0.1, 0.02, 0.03], rpy_deg: [90, 10, 20]}
"""
SEEN = SE3.exp(np.array([0.05, -0.03, 0.7, 0.3, -0.2, 2.5]))  # camera from cube


def detection(tag: int, corners: np.ndarray, family: str = "tag36h11") -> SimpleNamespace:
    """Return a tag as the detector publishes it: counter-clockwise from top right, counted from the image border."""
    points = [SimpleNamespace(x=x + 0.5, y=y + 0.5) for x, y in corners[[1, 0, 3, 2]]]
    return SimpleNamespace(id=tag, corners=points, family=family)


def array(*found: SimpleNamespace) -> SimpleNamespace:
    return SimpleNamespace(detections=list(found))


TAGS_OF_BOARD = Tags("tag36h11", np.array([0, 1, 3]), np.array([[3, 2, 1, 0], [7, 6, 5, 4], [15, 14, 13, 12]]))


def test_tag_corners_have_target_ids() -> None:
    """Corners are reordered to OpenCV's order and counted from the centre of the first pixel.

    Unknown tags are dropped.
    """
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
def test_invalid_tag_detections_give_none(found: SimpleNamespace) -> None:
    """No tag, an unknown tag, a repeated tag, and non-finite corners give None."""
    assert tag_corners(found, TAGS_OF_BOARD) is None


def add_tags(bag: BagWriter, time: float, *found: SimpleNamespace) -> None:
    point = bag.store.types["apriltag_msgs/msg/Point"]
    made = [
        bag.make("apriltag_msgs/msg/AprilTagDetection", "tag36h11", each.id, 0, 0.0, 50.0, point(0.0, 0.0),
                 [point(corner.x, corner.y) for corner in each.corners], np.eye(3).ravel())
        for each in found
    ]  # fmt: skip
    bag.add("/detections", TAGS, time, bag.make(TAGS, bag.header(time), made))


def write_tag_bag(folder: Path, kind: Kind) -> Path:
    """Write a bag in which an arm rests at two poses and sees a board at each."""
    bag = new_bag(folder, kind)
    for name, text in DEFINITIONS.items():
        bag.store.register(get_types_from_msg(text, name))
    for k in range(60):
        time = BEGIN_S + k / 20
        bag.pose("/arm/pose", time, SE3(np.eye(3), np.array([0.1 * (k >= 30), 0.0, 0.5])))
        add_tags(bag, time, *([] if k % 2 else [detection(0, SQUARE + k), detection(1, SQUARE + 60)]))
    return bag.close()


@pytest.mark.journey
@pytest.mark.parametrize("kind", KINDS)
def test_tag_detections_become_rows(kind: Kind, tmp_path: Path) -> None:
    """Each image with a detected tag is a row with its corners by the target's ids."""
    cell = cell_from_dict(parse_yaml(CELL, "cell.yaml").data)
    asked = BagRequest(robots={"arm": "/arm/pose"}, views={("wrist", "board"): "/detections"})
    with open_bag(write_tag_bag(tmp_path, kind)) as bag:
        survey = survey_bag(bag)
        taken = choose_sources(bag, survey, asked, cell)
        tracks = read_tracks(bag, survey, taken)
        rows = list(make_rows(tracks, stream_instants(tracks, bag.path), {}))
        with pytest.raises(InputError, match=r"'none' must be in cell\.yaml, with tag sizes; there is board"):
            choose_sources(bag, survey, BagRequest(asked.robots, views={("wrist", "none"): "/detections"}), cell)
    views = [view for row in rows for view in row.observations]
    assert len(views) == 30
    assert isinstance(views[2], PixelObservation)
    upright = [1, 0, 3, 2]  # Kalibr's tags are rotated by half a turn from OpenCV's
    by_id = dict(zip(views[2].ids.tolist(), views[2].pixels.tolist(), strict=True))
    np.testing.assert_allclose([by_id[k] for k in upright], SQUARE + 4)
    np.testing.assert_allclose([by_id[4 + k] for k in upright], SQUARE + 60)


def cell() -> Cell:
    return cell_from_dict(parse_yaml(TAG_CELL, "cell.yaml").data)


def published_pose(camera_from_target: SE3, number: int, half_m: float) -> SE3:
    """Return the pose that the node computes, by solvePnP of the square (-s,-s), (s,-s), (s,s), (-s,s).

    The detector begins at the lower left and goes counter-clockwise. The corners that `tag_corners` names by the
    target's ids are the target's points, at their places in an image of the cube.
    """
    shape = cell().targets["cube"].target
    assert shape is not None
    assert shape.tags is not None
    matrix = np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]])
    points = SimpleNamespace(
        id=number, family="tag36h11", corners=[SimpleNamespace(x=float(k), y=0.5) for k in range(4)]
    )
    named = tag_corners(SimpleNamespace(detections=[points]), shape.tags)
    assert named is not None
    of_corner = {round(x + 0.5): int(name) for name, (x, _) in zip(named.ids, named.pixels, strict=True)}
    places = shape.points[shape.rows(np.array([of_corner[k] for k in range(4)]))]
    in_camera = camera_from_target @ places
    pixels = (in_camera[:, :2] / in_camera[:, 2:]) * 600 + matrix[:2, 2]
    square = half_m * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    _, turn, move = cv2.solvePnP(square, pixels, matrix, None, flags=cv2.SOLVEPNP_ITERATIVE)
    return SE3(cv2.Rodrigues(turn)[0], move.ravel())


def tag_detection(bag: BagWriter, package: str, numbers: list[int], pose: SE3) -> Any:
    point = bag.make("geometry_msgs/msg/Point", *map(float, pose.translation))
    turn = bag.make("geometry_msgs/msg/Quaternion", *map(float, pose.quaternion))
    inner = bag.make(
        "geometry_msgs/msg/PoseWithCovariance", bag.make("geometry_msgs/msg/Pose", point, turn), np.zeros(36)
    )
    stamped = bag.make("geometry_msgs/msg/PoseWithCovarianceStamped", bag.header(BEGIN_S), inner)
    return bag.make(
        f"{package}/msg/AprilTagDetection", np.array(numbers, dtype=np.int32), np.full(len(numbers), 0.08), stamped
    )


def write_pose_bag(folder: Path, package: str, *images: list[tuple[list[int], SE3]]) -> Path:
    bag = new_bag(folder, "ros1")
    for name, text in DEFINITIONS.items():
        bag.store.register(get_types_from_msg(text, name))
    kind = f"{package}/msg/AprilTagDetectionArray"
    for k, found in enumerate(images):
        time = BEGIN_S + k / 10
        bag.pose("/arm/pose", time, SE3(np.eye(3), np.array([0.01 * k, 0.0, 0.5])))
        made = [tag_detection(bag, package, numbers, pose) for numbers, pose in found]
        bag.add("/tag_detections", kind, time, bag.make(kind, bag.header(time), made))
    return bag.close()


def views(path: Path, target: str, folder: Path) -> list[SE3]:
    asked = BagRequest(robots={"arm": "/arm/pose"}, views={("wrist", target): "/tag_detections"}, on={target: "world"})
    with open_bag(path) as bag:
        survey = survey_bag(bag)
        tracks = read_tracks(bag, survey, choose_sources(bag, survey, asked, cell()))
        rows = list(make_rows(tracks, stream_instants(tracks, bag.path), {}))
    seen = [view for row in rows for view in row.observations]
    assert all(isinstance(view, PoseObservation) for view in seen)
    return [view.camera_from_target for view in seen if isinstance(view, PoseObservation)]


@pytest.mark.parametrize("package", PACKAGES)
def test_tag_poses_become_target_poses(package: str, tmp_path: Path) -> None:
    """Poses of either tag give the target's pose as the node computes it.

    The nearer of two tags is used; unknown tags and bundles are not.
    """
    by_three, by_seven = published_pose(SEEN, 3, 0.04), published_pose(SEEN, 7, 0.02)
    off = SE3.exp(np.array([0.0, 0, 0.3, 0, 0, 0]))
    images = [
        [([3], by_three)],
        [([7], by_seven)],
        [([3], off @ by_three), ([7], by_seven)],
        [([5], off), ([3, 7], off)],
    ]
    found = views(write_pose_bag(tmp_path, package, *images), "cube", tmp_path)
    assert len(found) == 3
    for pose in found:
        np.testing.assert_allclose(pose.matrix, SEEN.matrix, atol=1e-5)


def test_target_without_tags_uses_only_detection(tmp_path: Path) -> None:
    """The pose is in the detector's own frame; an image with two tags is ambiguous and dropped."""
    near = SE3.exp(np.array([0.0, 0, 0.5, 0.1, 0, 0]))
    found = views(
        write_pose_bag(tmp_path, PACKAGES[0], [([12], SEEN)], [([12], SEEN), ([13], near)]), "plate", tmp_path
    )
    assert len(found) == 1
    np.testing.assert_allclose(found[0].matrix, SEEN.matrix, atol=1e-12)


def test_distant_small_tag_has_exact_rotation() -> None:
    """Corners that differ by a few thousand rounding units still give a rotation to 1e-12."""
    text = TAG_CELL.replace("0.08, t_m: [0, 0, 0]", "1e-6, t_m: [1e6, 1e6, 3e5]").replace("0.04", "1e-6")
    shape = cell_from_dict(parse_yaml(text, "cell.yaml").data).targets["cube"].target
    for frame in frames_of_tags(shape).tag_from_target.values():
        np.testing.assert_allclose(frame.rotation @ frame.rotation.T, np.eye(3), atol=1e-12)


def test_tag_frame_is_rotated_by_half_turn() -> None:
    """For a tag at its target's origin x points left, y down and z, out of the tag, against the target's z."""
    frames = frames_of_tags(cell().targets["cube"].target)
    np.testing.assert_allclose(frames.tag_from_target[3].rotation, np.diag([-1.0, 1.0, -1.0]), atol=1e-12)
    assert frames_of_tags(None).tag_from_target == {}
    assert set(TAG_POSES) < set(DEFINITIONS)
