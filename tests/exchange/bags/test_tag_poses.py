"""Poses of AprilTags in bags of ROS 1."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg
from tests.bag_of_cell import BEGIN_S, Wrote, new_bag

from basecal.cell import Cell, PoseObservation
from basecal.cell.files import cell_from_dict
from basecal.cell.format.yaml_text import parse_yaml
from basecal.exchange.bags.bag import open_bag
from basecal.exchange.bags.choice import choose_sources
from basecal.exchange.bags.rows import make_rows, stream_instants
from basecal.exchange.bags.sources import Asked
from basecal.exchange.bags.survey import survey_bag
from basecal.exchange.bags.tag_poses import PACKAGES, POSE_DEFINITIONS, TAG_POSES, frames_of_tags
from basecal.exchange.bags.tags import tag_corners
from basecal.exchange.bags.tracks import read_tracks
from basecal.geometry import SE3

CELL = """\
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


def cell() -> Cell:
    return cell_from_dict(parse_yaml(CELL, "cell.yaml").data)


def as_published(camera_from_target: SE3, number: int, half_m: float) -> SE3:
    """What the node computes: solvePnP of the square (-s,-s), (s,-s), (s,s), (-s,s) and of the detector's corners.

    The detector begins lower left and goes against the clock: corners that `tag_corners` names by the target's ids are
    the points of the target, which an image of the cube shows where they are.
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


def detection(bag: Wrote, package: str, numbers: list[int], pose: SE3) -> Any:
    point = bag.make("geometry_msgs/msg/Point", *map(float, pose.translation))
    turn = bag.make("geometry_msgs/msg/Quaternion", *map(float, pose.quaternion))
    inner = bag.make(
        "geometry_msgs/msg/PoseWithCovariance", bag.make("geometry_msgs/msg/Pose", point, turn), np.zeros(36)
    )
    stamped = bag.make("geometry_msgs/msg/PoseWithCovarianceStamped", bag.header(BEGIN_S), inner)
    return bag.make(
        f"{package}/msg/AprilTagDetection", np.array(numbers, dtype=np.int32), np.full(len(numbers), 0.08), stamped
    )


def written(folder: Path, package: str, *images: list[tuple[list[int], SE3]]) -> Path:
    bag = new_bag(folder, "ros1")
    for name, text in POSE_DEFINITIONS.items():
        bag.store.register(get_types_from_msg(text, name))
    kind = f"{package}/msg/AprilTagDetectionArray"
    for k, found in enumerate(images):
        time = BEGIN_S + k / 10
        bag.pose("/arm/pose", time, SE3(np.eye(3), np.array([0.01 * k, 0.0, 0.5])))
        made = [detection(bag, package, numbers, pose) for numbers, pose in found]
        bag.add("/tag_detections", kind, time, bag.make(kind, bag.header(time), made))
    return bag.close()


def views(path: Path, target: str, folder: Path) -> list[SE3]:
    asked = Asked(robots={"arm": "/arm/pose"}, views={("wrist", target): "/tag_detections"}, on={target: "world"})
    with open_bag(path) as bag:
        survey = survey_bag(bag)
        tracks = read_tracks(bag, survey, choose_sources(bag, survey, asked, cell()))
        rows = list(make_rows(tracks, stream_instants(tracks, bag.path), {}))
    seen = [view for row in rows for view in row.observations]
    assert all(isinstance(view, PoseObservation) for view in seen)
    return [view.camera_from_target for view in seen if isinstance(view, PoseObservation)]


@pytest.mark.parametrize("package", PACKAGES)
def test_poses_of_tags_become_poses_of_their_target(package: str, tmp_path: Path) -> None:
    """As the node finds them, by either tag; of both the nearer is taken, strangers and bundles are not."""
    by_three, by_seven = as_published(SEEN, 3, 0.04), as_published(SEEN, 7, 0.02)
    off = SE3.exp(np.array([0.0, 0, 0.3, 0, 0, 0]))
    images = [
        [([3], by_three)],
        [([7], by_seven)],
        [([3], off @ by_three), ([7], by_seven)],
        [([5], off), ([3, 7], off)],
    ]
    found = views(written(tmp_path, package, *images), "cube", tmp_path)
    assert len(found) == 3
    for pose in found:
        np.testing.assert_allclose(pose.matrix, SEEN.matrix, atol=1e-5)


def test_a_target_without_tags_is_the_only_detection(tmp_path: Path) -> None:
    """In the detector's own frame; an image of two says not which."""
    near = SE3.exp(np.array([0.0, 0, 0.5, 0.1, 0, 0]))
    found = views(written(tmp_path, PACKAGES[0], [([12], SEEN)], [([12], SEEN), ([13], near)]), "plate", tmp_path)
    assert len(found) == 1
    np.testing.assert_allclose(found[0].matrix, SEEN.matrix, atol=1e-12)


def test_a_far_and_small_tag_has_a_rotation() -> None:
    """Corners that differ by a few thousand roundings still give a rotation to 1e-12."""
    text = CELL.replace("0.08, t_m: [0, 0, 0]", "1e-6, t_m: [1e6, 1e6, 3e5]").replace("0.04", "1e-6")
    shape = cell_from_dict(parse_yaml(text, "cell.yaml").data).targets["cube"].target
    for frame in frames_of_tags(shape).tag_from_target.values():
        np.testing.assert_allclose(frame.rotation @ frame.rotation.T, np.eye(3), atol=1e-12)


def test_a_tag_stands_half_a_turn_from_how_opencv_draws_it() -> None:
    """Of a tag at its target's origin x goes left, y down, and z, out of it, against the target's."""
    frames = frames_of_tags(cell().targets["cube"].target)
    np.testing.assert_allclose(frames.tag_from_target[3].rotation, np.diag([-1.0, 1.0, -1.0]), atol=1e-12)
    assert frames_of_tags(None).tag_from_target == {}
    assert set(TAG_POSES) < set(POSE_DEFINITIONS)
