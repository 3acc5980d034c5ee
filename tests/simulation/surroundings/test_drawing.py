"""Tests of MuJoCo's images against the true geometry."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.targets.led import led_target
from basecal.geometry import SE3, Camera
from basecal.simulation.running.plant import Clock, Plant
from basecal.simulation.running.ur5e import ur5e
from basecal.simulation.surroundings.drawing import BodyPoses, Surroundings
from basecal.simulation.surroundings.graphics import missing_graphics
from basecal.simulation.surroundings.model import Stage
from basecal.vision.detectors import find_target
from shared.facing_arms import facing_arms

WHY = missing_graphics()
pytestmark = pytest.mark.skipif(WHY is not None, reason=f"MuJoCo draws nothing here: {WHY}")
LENS = Camera("pinhole", np.array([500.0, 498.0, 322.0, 236.0, -0.2, 0.08, 0.001, -0.001, 0.0]), (640, 480))
FAR = SE3(np.eye(3), np.array([0.0, 0.0, -50.0]))  # out of view


@pytest.fixture(scope="module")
def world():
    return facing_arms("charuco")


@pytest.fixture(scope="module")
def board(world):
    return world.cell.targets["board"].target


def around(target, chains=None, tray=None):
    return Surroundings(Stage(chains or {}, {"eye": np.zeros(3)}, target, 0, tray), LENS)


def looking_down(target, height_m=1.0):
    """Poses of a camera above the table that looks down at a target half-way."""
    down = np.diag([1.0, -1.0, -1.0])
    world_from_camera = SE3(down, np.array([0.0, 0.0, height_m]))
    return BodyPoses(world_from_camera, world_from_camera @ SE3(np.eye(3), np.array([0.0, 0.0, 0.5])), {})


def test_detected_corners_match_projection(world):
    """Corners in the image of a running cell, through a distorting lens, are within 0.2 px of the truth."""
    running = Plant(world, Clock(0), surroundings=True)
    try:
        shape = world.cell.targets["board"].target
        found = find_target(running.shot("wrist").image, shape)
        seen = running._camera_scene("wrist", 0.0)
        true = world.lenses["wrist"].project(seen.camera_from_target @ shape.points)
        assert len(found.ids) == len(shape.ids)
        assert np.abs(found.pixels - true[shape.rows(found.ids)]).max() < 0.2
    finally:
        running.close()


def test_paper_matches_its_projection(board):
    """The border of the plate that MuJoCo draws is that of the sheet, through the lens, within a third of a pixel."""
    view = around(board)
    scene = looking_down(board)
    try:
        paper = view.backdrop(scene).paper
    finally:
        view.close()
    left, top, right, bottom = board.sheets[0].paper
    corners = np.array([[left, top, 0], [right, top, 0], [right, bottom, 0], [left, bottom, 0]])
    camera_from_sheet = scene.world_from_camera.inverse() @ scene.world_from_target @ board.sheets[0].target_from_sheet
    edge = np.linspace(corners, np.roll(corners, -1, axis=0), 400, axis=1).reshape(-1, 3)
    u, v = LENS.project(camera_from_sheet @ edge).T
    pieces = u * np.roll(v, -1) - np.roll(u, -1) * v
    area = 0.5 * float(pieces.sum())
    middle = [float((pieces * (each + np.roll(each, -1))).sum()) / (6 * area) for each in (u, v)]
    perimeter = float(np.sum(np.hypot(np.diff(u), np.diff(v))))
    assert paper.sum() == pytest.approx(abs(area), abs=perimeter / 3)
    down, across = np.mgrid[: paper.shape[0], : paper.shape[1]]
    assert np.allclose([np.average(each, weights=paper) for each in (across, down)], middle, atol=0.2)


def test_arm_occludes_the_board(board):
    """A link in front of the board covers its paper; elsewhere the paper is unchanged."""
    view = around(board, {"eye": ur5e()})
    free = looking_down(board)
    frames = [FAR] * 7
    before = BodyPoses(free.world_from_camera, free.world_from_target, {"eye": tuple(frames)})
    frames[3] = SE3(np.eye(3), np.array([0.2, 0.03, 0.7]))
    after = BodyPoses(free.world_from_camera, free.world_from_target, {"eye": tuple(frames)})
    try:
        shown, left = (view.backdrop(scene).paper for scene in (before, after))
    finally:
        view.close()
    assert 0.1 < 1 - left.sum() / shown.sum() < 0.9
    assert (left - shown).max() < 0.01


def test_led_is_occluded_and_mirrored():
    """Objects in front of an LED occlude it. The tray reflects it if it is in the right place and the view is free."""
    light, height = led_target(), 0.1
    view = around(light, tray=np.array([0.1, 0.0, height]))
    at, away = np.array([[0.0, 0.0, 0.3]]), np.array([50.0, 0.0, 0.0])
    scene = BodyPoses(
        SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.3, 0.0, 1.0])), SE3(np.eye(3), at[0] - light.points[0]), {}
    )
    below = at * [1, 1, -1] + [0, 0, 2 * height]
    try:
        assert view.is_visible(scene, at).tolist() == [True]
        assert view.is_visible(scene, below).tolist() == [False]
        assert view.is_mirrored(scene, below).tolist() == [True]
        assert view.is_mirrored(scene, below + away).tolist() == [False]
        assert view.is_mirrored(scene, np.zeros((0, 3))).tolist() == []
    finally:
        view.close()


def test_image_depends_only_on_the_scene(board):
    """The same scene gives the same image again, after another one."""
    view = around(board)
    scene, other = looking_down(board), looking_down(board, 1.1)
    try:
        first, between, again = (view.backdrop(each).levels for each in (scene, other, scene))
    finally:
        view.close()
    assert np.array_equal(first, again)
    assert not np.array_equal(first, between)
    assert scene == looking_down(board)
    assert scene != other
