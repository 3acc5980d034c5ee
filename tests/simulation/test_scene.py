"""Scenes: bases apart, homes within reach, every camera looking at its target."""

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
def test_homes_show_the_target_within_the_distances(layout, seed):
    """Every first view of a group sees its whole target, its middle 0.5 to 0.9 m from the camera."""
    scene = scene_of(seed, layout=layout)
    for group, home in zip(scene.layout.groups, scene.homes, strict=True):
        camera, target = group[0]
        states = {robot: pose[None] for robot, pose in home.items()}
        assert seen_points(scene, Scenario(layout=layout), (camera, target), states).all()
        middle = scene.camera_from_target((camera, target), home) @ scene.shapes[target].points.mean(0)
        assert 0.5 <= np.linalg.norm(middle) <= 0.9 * 1.2


def test_targets_at_home_are_on_all_sides_of_the_image_and_within_reach():
    """The middle of a board is off the optical axis by a tenth of its distance at most; a flange 0.4 to 0.8 m off."""
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
def test_bases_stand_apart_and_the_first_is_the_world(layout):
    """Neighbours 1 to 2 m from one another, to the decimetre and a half of either's place."""
    scene = scene_of(4, layout=layout)
    np.testing.assert_array_equal(scene.bases[scene.layout.robots[0]].matrix, np.eye(4))
    places = [scene.bases[robot].translation for robot in scene.layout.robots]
    for first, second in zip(places, [*places[1:], places[0]], strict=True):
        assert 0.65 < np.linalg.norm(first - second) < 2.35


def test_most_bases_are_upright_and_some_are_not():
    """A fifth of 200 is turned anyhow (sigma 3 %), the others are tilted by 0.3 rad at most."""
    scenes = [scene_of(seed) for seed in range(200)]
    first = [scene.bases["hand"].rotation for scene in scenes]
    # Both bases may tilt, and the first one is taken for the world.
    tilt = np.array([np.arccos(np.clip(each[2, 2], -1, 1)) for each in first])
    assert 0.15 < np.mean(tilt > 0.6) < 0.45


def test_a_thing_is_where_its_carrier_is():
    """By base, flange and mount; on the world by its mount alone."""
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
def test_boards_are_flat_and_bodies_are_not(target, flat):
    """A light is seen from everywhere, too."""
    shape = scene_of(target=target).shapes["board"]
    assert is_flat(shape) is flat


def test_the_front_of_a_board_is_a_rotation():
    """That of its sheet; of what has none its own axes."""
    board = scene_of(target="charuco").shapes["board"]
    np.testing.assert_allclose(front(board) @ front(board).T, np.eye(3), atol=1e-12)
    np.testing.assert_array_equal(front(board), board.sheets[0].target_from_sheet.rotation)
    np.testing.assert_array_equal(front(led_target()), np.eye(3))


def test_a_pose_of_a_light_loses_its_rotation_and_not_its_place():
    """The only point stays where it is, of one pose and of many."""
    light = led_target()
    poses = SE3(rotations(np.random.default_rng(0), 4), np.arange(12.0).reshape(4, 3))
    for pose in (poses, poses[1]):
        bare = as_point(pose, light)
        np.testing.assert_allclose(bare @ light.points[0], pose @ light.points[0])
        np.testing.assert_array_equal(bare.rotation, np.broadcast_to(np.eye(3), pose.rotation.shape))


def test_a_seed_tells_the_scene_whatever_is_stated():
    """Noise and statuses change nothing, another seed everything."""
    plain, noisy = scene_of(7), scene_of(7, pixel_px=3.0, base="prior", robot_noise=(1e-3, 1e-3))
    np.testing.assert_array_equal(plain.bases["hand"].matrix, noisy.bases["hand"].matrix)
    np.testing.assert_array_equal(plain.homes[0]["eye"].matrix, noisy.homes[0]["eye"].matrix)
    assert np.abs(plain.bases["hand"].matrix - scene_of(8).bases["hand"].matrix).max() > 0.01


def test_flanges_are_drawn_above_the_base_in_every_direction():
    """0.4 to 0.8 m off, with any rotation."""
    poses = _poses_in_reach(np.random.default_rng(0), 2000)
    away = np.linalg.norm(poses.translation, axis=1)
    assert 0.4 <= away.min() < 0.405 < 0.795 < away.max() <= 0.8
    direction = poses.translation / away[:, None]
    assert direction[:, 2].min() > 0
    np.testing.assert_allclose(direction.mean(0), [0, 0, 0.5], atol=0.05)  # sigma 0.013
    np.testing.assert_allclose(poses.rotation.mean(0), np.zeros((3, 3)), atol=0.06)


@pytest.mark.parametrize("target", ["charuco", "points", "led"])
def test_views_are_near_the_optical_axis(target):
    """Within a tenth of the distance, from the nearest to the farthest; a board is tilted by 0.4 rad at most."""
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
def test_neighbours_are_a_metre_and_a_half_apart_on_average(count):
    """Up to half a metre more or less, and a decimetre of either's place; bases are about one height."""
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


def test_one_base_is_the_world():
    assert list(_draw_bases(np.random.default_rng(0), ("arm",))) == ["arm"]


def test_homes_are_within_reach():
    """A quarter of a metre to 1.1 m from the base, of every robot."""
    scenes = [scene_of(seed, layout=layout) for seed in range(4) for layout in ("dual", "eye_in_hand", "eye_to_hand")]
    away = [np.linalg.norm(home.translation) for scene in scenes for group in scene.homes for home in group.values()]
    assert min(away) >= 0.25
    assert max(away) <= 1.1


def test_two_points_in_a_plane_are_a_board():
    """One point is a light; points off the plane are a body."""
    assert [is_flat(points_target(points)) for points in ([[0, 0, 0]], [[0, 0, 0], [0.1, 0, 0]])] == [False, True]
    assert not is_flat(points_target([[0, 0, 0], [0.1, 0, 0.01]]))
