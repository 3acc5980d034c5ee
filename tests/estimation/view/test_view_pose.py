"""Tests of poses of a target in single views."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.view import view_pose
from basecal.estimation.view.bearings import BearingMeasurement
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.view_pose import PoseCache, ViewPoses, refine_poses, view_poses
from basecal.geometry import SE3, Array, Camera
from basecal.geometry.rotation import rotation_exp

FLAT = np.array([[x, y, 0.0] for x in np.linspace(0.2, 0.4, 5) for y in np.linspace(0.02, 0.18, 4)])
DEEP = FLAT + np.random.default_rng(0).standard_normal(FLAT.shape) * [0, 0, 0.05]


def directions_from(pose: SE3, points: Array, noise: float = 0.0) -> BearingMeasurement:
    at = (pose.rotation @ points.T).swapaxes(1, 2) + pose.translation[:, None]
    at = at / np.linalg.norm(at, axis=-1, keepdims=True)
    at = at + noise * np.random.default_rng(1).standard_normal(at.shape)
    unit = at / np.linalg.norm(at, axis=-1, keepdims=True)
    return BearingMeasurement(points, unit, np.full(at.shape[:2], 2000.0))


def poses_of(chords: BearingMeasurement) -> ViewPoses:
    return view_poses(chords.points_in_target, chords.bearings_in_camera, chords.weight > 0, chords)


def tilted_poses(n: int, distance: float) -> SE3:
    """Boards tilted by 0.3 to 0.8 rad, before the camera."""
    rng = np.random.default_rng(4)
    axis = rng.standard_normal((n, 3)) * [1, 1, 0.3]
    turn = axis / np.linalg.norm(axis, axis=-1, keepdims=True) * rng.uniform(0.3, 0.8, (n, 1))
    centred = SE3.from_rotvec(turn, rng.uniform(-0.1, 0.1, (n, 3)) + np.array([0, 0, distance]))
    return centred @ SE3(np.eye(3), -FLAT.mean(0))


@pytest.mark.parametrize("points", [FLAT, DEEP], ids=["flat", "deep"])
def test_exact_directions_give_the_exact_pose(points):
    """The pose is exact to 1e-8, with zero cost."""
    pose = tilted_poses(12, 0.7)
    found = poses_of(directions_from(pose, points))
    assert found.has_pose.all()
    assert np.abs((pose.inverse() @ found.camera_from_target[:, 0]).log()).max() < 1e-8
    assert found.cost[:, 0].max() < 1e-8


@pytest.mark.parametrize("at", [[-1.0, 0.1, 0.3], [0.1, -1.0, 0.3], [1.0, 1.0, 0.2], [0.0, 0.0, 0.2]], ids=str)
@pytest.mark.parametrize("points", [FLAT, DEEP], ids=["flat", "deep"])
def test_target_is_found_at_any_place_before_the_camera(points, at):
    """The target may be far to a side, or so near that it fills the view, at any rotation.

    The closed form alone finds it.
    """
    rng = np.random.default_rng(2)
    pose = SE3.from_rotvec(rng.standard_normal((8, 3)), np.tile(at, (8, 1))) @ SE3(np.eye(3), -points.mean(0))
    exact = directions_from(pose, points)
    found = view_poses(points, exact.bearings_in_camera, exact.weight > 0, exact, iterations=0)
    assert np.abs((pose.inverse() @ found.camera_from_target[:, 0]).log()).max() < 1e-7


def test_second_pose_of_a_plane_is_two_half_turns():
    """The second pose is rotated by half a turn about the normal and then about the line of sight, before any step.

    The middle of the plane is fixed.
    """
    pose, middle = tilted_poses(6, 0.7), FLAT.mean(0)
    exact = directions_from(pose, FLAT)
    second = view_poses(FLAT, exact.bearings_in_camera, exact.weight > 0, exact, iterations=0).camera_from_target[:, 1]
    at = np.stack([each @ middle for each in pose])
    sight = at / np.linalg.norm(at, axis=-1, keepdims=True)
    about_normal, about_sight = (rotation_exp(np.pi * axis) for axis in (pose.rotation[..., 2], sight))
    np.testing.assert_allclose(second.rotation, about_sight @ about_normal @ pose.rotation, atol=1e-7)
    np.testing.assert_allclose(np.stack([each @ middle for each in second]), at, atol=1e-8)


@pytest.mark.parametrize("distance", [0.0, 1e-170, 3.8e-14, 1e-12, 1e-9])
def test_mirrored_pose_at_the_camera_is_a_rotation(distance):
    """The mirrored pose of a plane has an orthogonal matrix at distances down to zero."""
    toward = np.array([[-0.07, -0.27, 0.96]]) / np.linalg.norm([-0.07, -0.27, 0.96])
    pose = SE3(rotation_exp(np.array([[0.3, 1.2, -0.4]])), distance * toward)
    mirrored = view_pose._mirror_normal(pose).rotation
    assert np.allclose(mirrored.mT @ mirrored, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("steps", [0, 3])
def test_pixel_views_are_refined_with_a_fixed_lens(steps):
    """Poses of pixel views are refined with a fixed lens, and the information is of the pose alone."""
    pose, camera = tilted_poses(3, 0.7), Camera("pinhole", [900.0, 900.0, 640.0, 360.0])
    at = (pose.rotation @ FLAT.T).swapaxes(1, 2) + pose.translation[:, None]
    seen = np.ones(at.shape[:2], dtype=bool)
    pixels = PixelMeasurement(FLAT, camera.project(at), seen, 1.0 * seen, 1.0 * seen)
    found = refine_poses(pixels, pose, camera, steps)
    np.testing.assert_allclose((pose.inverse() @ found.camera_from_target).log(), 0.0, atol=1e-9)
    np.testing.assert_allclose(found.information, pixels.linearise(pose, camera, False).information, rtol=1e-6)


def test_second_candidate_of_a_plane_has_the_opposite_tilt():
    """From afar, with noise, the truth is one of the two, which differ by about twice the board's tilt."""
    pose = tilted_poses(40, 3.0)
    found = poses_of(directions_from(pose, FLAT, 2e-4))
    off = np.linalg.norm((pose[:, None].inverse() @ found.camera_from_target).log()[..., 3:], axis=-1)
    assert off.min(-1).max() < 0.3
    assert np.all(found.cost[:, 0] <= found.cost[:, 1])
    sight = pose.translation + (pose.rotation @ FLAT.mean(0)[:, None])[..., 0]
    sight /= np.linalg.norm(sight, axis=-1, keepdims=True)
    tilt = np.arccos(np.abs(np.sum(pose.rotation[..., 2] * sight, -1)))
    between = np.linalg.norm(
        (found.camera_from_target[:, 0].inverse() @ found.camera_from_target[:, 1]).log()[:, 3:], axis=-1
    )
    assert np.median(np.abs(between - 2 * tilt)) < 0.1


@pytest.mark.parametrize("few", [0, 1, 3])
def test_views_of_three_points_have_no_pose(few):
    """The cost of views with up to three points is infinite, and the other views are unchanged."""
    pose = tilted_poses(3, 0.7)
    chords = directions_from(pose, FLAT)
    chords.weight[1, few:] = 0.0
    found = poses_of(chords)
    assert found.has_pose.tolist() == [True, False, True]


def test_refinement_never_increases_a_cost():
    """Each view's cost decreases or stays, from a start off by 0.2 rad, and nearly all end at the noise."""
    pose = tilted_poses(20, 0.7)
    chords = directions_from(pose, FLAT, 2e-4)
    start = pose @ SE3.exp(0.1 * np.random.default_rng(2).standard_normal((20, 6)))
    costs = np.array([refine_poses(chords, start, None, k).cost for k in range(6)])
    assert np.all(np.diff(costs, axis=0) <= 0)
    assert np.mean(costs[-1] < 0.01 * costs[0]) >= 0.95


def test_zero_steps_give_closed_form_poses():
    """Poses without steps are exact for exact directions.

    For noisy ones they are near, and no better than refined, each with its own information.
    """
    pose = tilted_poses(12, 0.7)
    exact = directions_from(pose, FLAT)
    found = view_poses(FLAT, exact.bearings_in_camera, exact.weight > 0, exact, iterations=0)
    assert np.abs((pose.inverse() @ found.camera_from_target[:, 0]).log()).max() < 1e-8
    noisy = directions_from(pose, FLAT, 5e-4)
    rough = view_poses(FLAT, noisy.bearings_in_camera, noisy.weight > 0, noisy, iterations=0)
    assert np.all(poses_of(noisy).cost[:, 0] <= rough.cost[:, 0])
    off = (poses_of(noisy).camera_from_target[:, 0].inverse() @ rough.camera_from_target[:, 0]).log()
    assert 0 < np.abs(off).max() < 0.05
    of_best = noisy.linearise(rough.camera_from_target[:, 0], None, False)
    np.testing.assert_allclose(rough.information, of_best.information)


def test_view_has_a_pose_if_its_best_cost_is_finite():
    """A view has a pose if its best cost is finite, whatever the cost of the second pose."""
    poses = SE3.identity((3, 2))
    found = ViewPoses(poses, np.array([[1.0, np.inf], [np.inf, np.inf], [1.0, 2.0]]), np.zeros((3, 6, 6))).has_pose
    assert found.tolist() == [True, False, True]


@pytest.mark.parametrize(("points", "fewest"), [(FLAT, 4), (DEEP, 6)], ids=["flat", "deep"])
def test_minimum_number_of_points_of_a_pose(points, fewest):
    """Four points of a plane, or six in space, have a pose. One point less has none."""
    pose = tilted_poses(2, 0.7)
    chords = directions_from(pose, points)
    spread = [0, 3, 16, 19, 9, 6]
    chords.weight[:] = 0.0
    chords.weight[0, spread[:fewest]] = chords.weight[1, spread[: fewest - 1]] = 2000.0
    found = poses_of(chords)
    assert found.has_pose.tolist() == [True, False]
    assert np.abs((pose[0].inverse() @ found.camera_from_target[0, 0]).log()).max() < 1e-6


BOARD = np.array([[x, y, 0.0] for y in range(4) for x in range(5)]) * 0.03


def board_views(count: int) -> BearingMeasurement:
    rng = np.random.default_rng(5)
    poses = SE3.from_rotvec(
        rng.uniform(-0.5, 0.5, (count, 3)), rng.uniform([-0.1, -0.1, 0.5], [0.1, 0.1, 0.8], (count, 3))
    )
    points = (poses.rotation @ BOARD.T).swapaxes(1, 2) + poses.translation[:, None]
    bearings = points / np.linalg.norm(points, axis=-1, keepdims=True) + 1e-4 * rng.standard_normal(points.shape)
    return BearingMeasurement(BOARD, bearings, np.full(points.shape[:2], 1e3))


def find_poses(poses, measurement: BearingMeasurement):
    seen = measurement.weight > 0
    return poses(measurement.points_in_target, measurement.bearings_in_camera, seen, measurement)


def test_cached_poses_equal_new_ones(monkeypatch):
    """Repeated views, in another order and beside new ones, have the poses of a single call.

    Only new ones are computed.
    """
    all_views, known, sought = board_views(6), PoseCache(), []

    def counted(points, bearings, seen, measurement):
        sought.append(len(bearings))
        return view_poses(points, bearings, seen, measurement)

    monkeypatch.setattr(view_pose, "view_poses", counted)
    find_poses(known, all_views.take(np.array([0, 1, 2, 3])))
    rows = np.array([5, 2, 0, 4])
    again, anew = find_poses(known, all_views.take(rows)), find_poses(view_poses, all_views.take(rows))
    assert sought == [4, 2]
    np.testing.assert_allclose(again.camera_from_target.matrix, anew.camera_from_target.matrix, atol=1e-9)
    np.testing.assert_allclose(again.cost, anew.cost, rtol=1e-6)
    np.testing.assert_allclose(again.information, anew.information, rtol=1e-9, atol=1e-3)


@pytest.mark.parametrize("change", ["weight", "points_in_target"])
def test_other_views_are_not_confused_with_cached_ones(change):
    """With other weights, or another target, the pose of a view is computed again."""
    first, known = board_views(2), PoseCache()
    find_poses(known, first)
    other = BearingMeasurement(**{**vars(first), change: 2.0 * getattr(first, change)})
    np.testing.assert_allclose(
        find_poses(known, other).camera_from_target.matrix,
        find_poses(view_poses, other).camera_from_target.matrix,
        atol=1e-9,
    )
    assert len(known.known) == 4
