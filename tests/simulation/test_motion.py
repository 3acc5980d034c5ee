"""Tests of robot motions and of the points visible from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.geometry import SE3, Camera
from basecal.numerics.batch import concatenate
from basecal.simulation.layout import make_layout
from basecal.simulation.motion import draw_motions, points_in_camera, seen_points
from basecal.simulation.scenario import Scenario
from basecal.simulation.scene import draw_scene, front

LENS = Camera("pinhole", np.array([100.0, 100.0, 49.5, 49.5]), (100, 100))
VIEW = ("wrist", "board")


def scene_of(scenario):
    return draw_scene(scenario, make_layout(scenario.layout, scenario.robots), np.random.default_rng(1))


def make_motions(scenario, scene=None):
    return draw_motions(scene or scene_of(scenario), scenario, np.random.default_rng(2), {})


def test_points_in_camera_follow_the_chain():
    """The points in the camera are those of the explicit chain of bases, flanges and mounts."""
    scene = scene_of(Scenario())
    home = scene.homes[0]
    eye = scene.bases["eye"] @ home["eye"] @ scene.mounts["wrist"]
    hand = scene.bases["hand"] @ home["hand"] @ scene.mounts["board"]
    expected = eye.inverse() @ (hand @ scene.shapes["board"].points)
    states = {robot: concatenate([pose[None], pose[None]]) for robot, pose in home.items()}
    np.testing.assert_allclose(points_in_camera(scene, VIEW, states)[1], expected, atol=1e-12)


@pytest.mark.parametrize(("angle_deg", "seen"), [(0, True), (70, True), (80, False), (180, False)])
def test_board_is_visible_from_its_front(angle_deg, seen):
    """A board rotated about its centre at 2.5 m is visible up to 75.5 deg, whose cosine is a quarter."""
    scenario = Scenario(pixel_px=0.0)
    scene = scene_of(scenario)
    board = scene.shapes["board"]

    turn = SE3.from_rotvec(np.radians([angle_deg, 0, 0]), np.zeros(3)).rotation @ front(board).T
    camera_from_board = SE3(turn, np.array([0, 0, 2.5]) - turn @ board.points.mean(0))
    eye = scene.body_pose("wrist", scene.homes[0])
    hand = scene.bases["hand"].inverse() @ eye @ camera_from_board @ scene.mounts["board"].inverse()
    states = {"eye": scene.homes[0]["eye"][None], "hand": hand[None]}
    assert seen_points(scene, scenario, VIEW, states).all() == seen


def test_pixel_noise_widens_image_margin():
    """The margin grows by five sigmas of a pixel. A point that noise may move out of the image is not visible."""
    scene = scene_of(Scenario(pixel_px=0.0))
    states = {robot: pose[None] for robot, pose in scene.homes[0].items()}
    low = scene.lenses["wrist"].project(points_in_camera(scene, VIEW, states)).min()
    for pixel_px, seen in (((low - 4) / 5, True), (low / 5, False)):
        assert seen_points(scene, Scenario(pixel_px=pixel_px), VIEW, states).all() == seen


@pytest.mark.parametrize(
    ("arms", "eye_stops", "hand_stops"),
    [("both", 12, 12), ("eye_still", 1, 12), ("hand_still", 12, 1), ("halves", 7, 7), ("stations", 3, 12)],
)
def test_number_of_stops_follows_the_scenario(arms, eye_stops, hand_stops):
    """Twelve samples have as many distinct poses of each arm as the scenario states."""
    motions = make_motions(Scenario(samples=12, arms=arms, stations=3))
    for robot, stops in (("eye", eye_stops), ("hand", hand_stops)):
        places = np.concatenate([motion.recorded[robot].matrix for motion in motions])
        assert len(places) == 12
        assert len(np.unique(np.round(places, 9), axis=0)) == stops


def test_still_robot_has_one_pose_error():
    """A still robot has a single error of its recorded pose.

    A moving one has an error per sample, with sigmas within 20 %.
    """
    scenario = Scenario(samples=200, arms="eye_still", robot_noise=(1e-3, 2e-3))
    (motion,) = make_motions(scenario)
    eye, hand = ((motion.recorded[r].inverse() @ motion.true[r]).log() for r in ("eye", "hand"))
    np.testing.assert_allclose(eye, np.tile(eye[0], (200, 1)), atol=1e-12)
    assert np.abs(eye[0]).max() > 0
    np.testing.assert_allclose(hand.std(0), np.repeat([1e-3, 2e-3], 3), rtol=0.2)


def test_zero_spread_means_no_motion():
    """Robots do not move without spread of rotation and position."""
    (motion,) = make_motions(Scenario(samples=3, spread_rad=0.0, position_m=0.0))
    for robot in ("eye", "hand"):
        assert np.ptp(motion.recorded[robot].matrix, axis=0).max() == 0


def test_samples_are_divided_among_groups():
    """Seven samples of a ring of three are divided into three, two and two, one pair after another."""
    motions = make_motions(Scenario(samples=7, layout="chain"))
    assert [(motion.group, len(motion.recorded["r1" if motion.group != 1 else "r2"])) for motion in motions] == [
        (0, 3),
        (1, 2),
        (2, 2),
    ]


def test_partial_views_are_optional():
    """Only whole boards are recorded by default. With `partial`, views of at least eight points are recorded, too."""
    near = Scenario(samples=30, distance_m=(0.25, 0.35), position_m=0.2)
    counts = {}
    for partial in (False, True):
        scenario = replace(near, partial=partial)
        scene = scene_of(scenario)
        (motion,) = make_motions(scenario, scene)
        seen = seen_points(scene, scenario, VIEW, motion.true).sum(1)
        counts[partial] = seen.min(), seen.max()
    whole = counts[False][1]
    assert counts[False] == (whole, whole)
    assert 8 <= counts[True][0] < whole


def test_too_few_visible_samples_are_refused():
    """An image of four pixels cannot show a board. The error states how many samples were found, and what to change."""
    scenario = Scenario(samples=5, camera=Camera("pinhole", LENS.parameters, (4, 4)))
    with pytest.raises(InputError, match=r"only 0 of 5 samples see the target after 2600 tries: make spread_rad"):
        make_motions(scenario)


def test_single_robot_cannot_be_still():
    """A still robot requires a second robot that moves."""
    with pytest.raises(InputError, match="'eye_still' needs two robots"):
        make_motions(Scenario(arms="eye_still", layout="eye_in_hand"))
