"""Tests of scenes: distances of bases, homes within reach, and cameras that face their targets."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from basecal.cell.cell import WORLD
from basecal.cell.targets.led import led_target
from basecal.cell.targets.points import points_target
from basecal.geometry import SE3
from basecal.simulation.draw import rotations
from basecal.simulation.layout import make_layout
from basecal.simulation.motion import seen_points
from basecal.simulation.scenario import LayoutName, Scenario
from basecal.simulation.scene import _draw_bases, _draw_views, _poses_in_reach, as_point, draw_scene, front, is_flat


def scene_of(seed=0, **fields):
    scenario = Scenario(**fields)
    return draw_scene(scenario, make_layout(scenario.layout, scenario.robots), np.random.default_rng(seed))


@pytest.mark.parametrize("layout", get_args(LayoutName))
@pytest.mark.parametrize("seed", range(3))
def test_target_is_visible_at_home(layout, seed):
    """The first view of every group shows the whole target.

    Its centre is 0.5 to 0.9 m from the camera, with a margin of 20 %.
    """
    scene = scene_of(seed, layout=layout)
    for group, home in zip(scene.layout.groups, scene.homes, strict=True):
        camera, target = group[0]
        states = {robot: pose[None] for robot, pose in home.items()}
        assert seen_points(scene, Scenario(layout=layout), (camera, target), states).all()
        middle = scene.camera_from_target((camera, target), home) @ scene.shapes[target].points.mean(0)
        assert 0.5 <= np.linalg.norm(middle) <= 0.9 * 1.2


def test_home_targets_vary_about_the_optical_axis():
    """The centre of a board is off the optical axis by at most a tenth of its distance.

    A parked flange is 0.4 to 0.8 m from its base.
    """
    scenes = [scene_of(seed) for seed in range(20)]
    seen = [scene.camera_from_target(scene.layout.groups[0][0], scene.homes[0]) for scene in scenes]
    middles = [pose @ scene.shapes["board"].points.mean(0) for pose, scene in zip(seen, scenes, strict=True)]
    off = np.array([middle[:2] / middle[2] for middle in middles])
    assert np.all(off.min(0) < -0.02)
    assert np.all(off.max(0) > 0.02)
    assert np.abs(off).max() <= 0.1
    away = [np.linalg.norm(pose.translation) for scene in scenes for pose in scene.parked.values()]
    assert 0.4 <= min(away) <= max(away) <= 0.8


@pytest.mark.parametrize("layout", ["dual", "chain"])
def test_bases_are_apart_and_first_is_world(layout):
    """Neighbouring bases are 1 to 2 m apart, within 0.35 m for the scatter of both. The first base is the world."""
    scene = scene_of(4, layout=layout)
    np.testing.assert_array_equal(scene.bases[scene.layout.robots[0]].matrix, np.eye(4))
    places = [scene.bases[robot].translation for robot in scene.layout.robots]
    for first, second in zip(places, [*places[1:], places[0]], strict=True):
        assert 0.65 < np.linalg.norm(first - second) < 2.35


@pytest.mark.journey
def test_most_bases_are_upright():
    """A fifth of 200 bases has a random rotation (sigma 3 %), the others are tilted by at most 0.3 rad."""
    scenes = [scene_of(seed) for seed in range(200)]
    first = [scene.bases["hand"].rotation for scene in scenes]
    # Both bases may tilt, and the first one is the world.
    tilt = np.array([np.arccos(np.clip(each[2, 2], -1, 1)) for each in first])
    assert 0.15 < np.mean(tilt > 0.6) < 0.45


def test_body_pose_follows_its_carrier():
    """A pose is the product of base, flange and mount; on the world it is the mount alone."""
    scene = scene_of(layout="eye_in_hand")
    home = scene.homes[0]
    expected = scene.bases["arm"] @ home["arm"] @ scene.mounts["wrist"]
    np.testing.assert_allclose(scene.body_pose("wrist", home).matrix, expected.matrix)
    assert scene.layout.targets["board"] == WORLD
    assert scene.body_pose("board", home) is scene.mounts["board"]
    np.testing.assert_allclose(
        scene.camera_from_target(("wrist", "board"), home).matrix, (expected.inverse() @ scene.mounts["board"]).matrix
    )


@pytest.mark.parametrize(("target", "flat"), [("charuco", True), ("circles", True), ("points", False), ("led", False)])
def test_boards_are_flat_targets(target, flat):
    """Boards are flat, points in space are not. An LED is not flat either, since it is visible from all sides."""
    shape = scene_of(target=target).shapes["board"]
    assert is_flat(shape) is flat


def test_front_of_board_is_sheet_rotation():
    """The front of a board is the rotation of its sheet, that of a target without a sheet the identity."""
    board = scene_of(target="charuco").shapes["board"]
    np.testing.assert_allclose(front(board) @ front(board).T, np.eye(3), atol=1e-12)
    np.testing.assert_array_equal(front(board), board.sheets[0].target_from_sheet.rotation)
    np.testing.assert_array_equal(front(led_target()), np.eye(3))


def test_as_point_removes_only_rotation():
    """The only point of an LED keeps its position, for one pose and for many."""
    light = led_target()
    poses = SE3(rotations(np.random.default_rng(0), 4), np.arange(12.0).reshape(4, 3))
    for pose in (poses, poses[1]):
        bare = as_point(pose, light)
        np.testing.assert_allclose(bare @ light.points[0], pose @ light.points[0])
        np.testing.assert_array_equal(bare.rotation, np.broadcast_to(np.eye(3), pose.rotation.shape))


def test_seed_determines_the_scene():
    """Noise and statuses do not change the scene, and another seed does."""
    plain, noisy = scene_of(7), scene_of(7, pixel_px=3.0, base="prior", robot_noise=(1e-3, 1e-3))
    np.testing.assert_array_equal(plain.bases["hand"].matrix, noisy.bases["hand"].matrix)
    np.testing.assert_array_equal(plain.homes[0]["eye"].matrix, noisy.homes[0]["eye"].matrix)
    assert np.abs(plain.bases["hand"].matrix - scene_of(8).bases["hand"].matrix).max() > 0.01


def test_flanges_are_drawn_above_the_base():
    """Flanges are 0.4 to 0.8 m from the base in every upward direction, with any rotation."""
    poses = _poses_in_reach(np.random.default_rng(0), 2000)
    away = np.linalg.norm(poses.translation, axis=1)
    assert 0.4 <= away.min() < 0.405 < 0.795 < away.max() <= 0.8
    direction = poses.translation / away[:, None]
    assert direction[:, 2].min() > 0
    np.testing.assert_allclose(direction.mean(0), [0, 0, 0.5], atol=0.05)  # sigma 0.013
    np.testing.assert_allclose(poses.rotation.mean(0), np.zeros((3, 3)), atol=0.06)


@pytest.mark.parametrize("target", ["charuco", "points", "led"])
def test_views_are_near_the_optical_axis(target):
    """Targets are within a tenth of the distance of the axis, at distances over the whole range.

    A board is tilted by at most 0.4 rad.
    """
    scenario = Scenario(target=target, distance_m=(0.5, 0.9))
    shape = scene_of(target=target).shapes["board"]
    seen = _draw_views(np.random.default_rng(0), scenario, shape, 1000)
    middle = seen @ shape.points.mean(0)
    assert 0.5 <= middle[:, 2].min() < 0.51 < 0.89 < middle[:, 2].max() <= 0.9
    off = middle[:, :2] / middle[:, 2:]
    assert -0.1 <= off.min() < -0.095
    assert 0.095 < off.max() <= 0.1
    away = (seen.rotation @ front(shape))[:, 2, 2]
    if is_flat(shape):
        tilt = np.arccos(np.clip(away, -1, 1))
        assert 0.35 < tilt.max() <= 0.4
    else:
        assert away.min() < -0.9
    right = (seen.rotation @ front(shape))[:, :2, 0]
    assert np.all(np.abs(np.mean(right, axis=0)) < 0.1)


@pytest.mark.parametrize("count", [2, 3, 5])
def test_mean_distance_of_neighbours_is_1_5_m(count):
    """Distances vary by up to half a metre, and positions by a decimetre. Bases are at similar heights."""
    names = tuple(f"r{k}" for k in range(count))
    rng = np.random.default_rng(0)
    places = np.array([[base.translation for base in _draw_bases(rng, names).values()] for _ in range(100)])
    apart = np.linalg.norm(places - np.roll(places, 1, axis=1), axis=2)
    assert 0.7 < apart.min() < 1.0
    assert 2.0 < apart.max() < 2.3
    assert apart.mean() == pytest.approx(1.5, abs=0.1)
    assert np.abs(places[..., 2]).max() <= 0.2
    directions = np.arctan2(places[:, 1, 1], places[:, 1, 0])
    assert np.ptp(directions) > 6


def test_single_base_is_drawn():
    """A single robot has one base, which is the world."""
    assert list(_draw_bases(np.random.default_rng(0), ("arm",))) == ["arm"]


def test_homes_are_within_reach():
    """The home of every robot is 0.25 to 1.1 m from its base."""
    scenes = [scene_of(seed, layout=layout) for seed in range(4) for layout in ("dual", "eye_in_hand", "eye_to_hand")]
    away = [np.linalg.norm(home.translation) for scene in scenes for group in scene.homes for home in group.values()]
    assert min(away) >= 0.25
    assert max(away) <= 1.1


def test_two_planar_points_are_flat():
    """Two points in a plane are flat like a board. A single point is not, nor are points off the plane."""
    assert [is_flat(points_target(points)) for points in ([[0, 0, 0]], [[0, 0, 0], [0.1, 0, 0]])] == [False, True]
    assert not is_flat(points_target([[0, 0, 0], [0.1, 0, 0.01]]))
