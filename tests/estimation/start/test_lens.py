"""Tests of estimating a lens from views of boards alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.shared.real_recordings import example

from basecal.cell import CellCamera
from basecal.cell.cell import Intrinsics, Unknown
from basecal.errors import InputError
from basecal.estimation.problem.build import build_problem
from basecal.estimation.start.lens import (
    _BoardViews,
    _Lenses,
    _poses,
    _thin_points,
    guessed_lens,
    lens_from_views,
)
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import SE3, Camera
from basecal.numerics.batch import stack

BOARD = np.array([[x, y, 0.0] for x in np.linspace(-0.15, 0.15, 6) for y in np.linspace(-0.1, 0.1, 5)])
SIZE = (1280, 720)
ASKED = CellCamera("camera", "eye", Unknown(), "pinhole", SIZE, Intrinsics("free"))


def lens(focal: float) -> Camera:
    return Camera("pinhole", [focal, 1.01 * focal, 650.0, 350.0, -0.1, 0.05, 0.0, 0.0, 0.0], SIZE)


def views(camera: Camera, noise: float = 0.1, count: int = 12) -> PixelMeasurement:
    rng = np.random.default_rng(0)
    distance = float(camera.focal.mean()) / 900 * rng.uniform(0.4, 0.8, count)
    place = np.column_stack([rng.uniform(-0.08, 0.08, (count, 2)), distance])
    poses = SE3.from_rotvec(rng.uniform(-0.5, 0.5, (count, 3)), place)
    pixels = camera.project((poses.rotation @ BOARD.T).swapaxes(1, 2) + poses.translation[:, None])
    seen = np.ones(pixels.shape[:2], dtype=bool)
    return PixelMeasurement(
        BOARD, pixels + noise * rng.standard_normal(pixels.shape), seen, 0.0 * seen, seen.astype(float)
    )


@pytest.mark.parametrize("focal", [600.0, 950.0, 1700.0, 3000.0])
def test_lens_is_found_from_any_guess(focal):
    """With 0.1 px of noise the focal lengths are right to a hundredth, from half to over two image widths."""
    true = lens(focal)
    found = lens_from_views(ASKED, [views(true)])
    np.testing.assert_allclose(found.parameters[:2], true.parameters[:2], rtol=0.01)
    np.testing.assert_allclose(found.parameters[2:4], true.parameters[2:4], atol=0.02 * focal)


def test_views_of_two_boards_are_combined():
    """Views in two groups give the lens of all of them in one, to a thousandth of the focal length."""
    whole = views(lens(950.0))
    halves = [whole.take(slice(0, 5)), whole.take(slice(5, None))]
    together, apart = lens_from_views(ASKED, [whole]), lens_from_views(ASKED, halves)
    np.testing.assert_allclose(apart.parameters[:2], together.parameters[:2], rtol=1e-3)


def test_lens_without_views_of_four_points_is_a_guess():
    """Views of three points do not determine a lens: it is one image width, centred, without distortion."""
    few = views(lens(950.0))
    few = PixelMeasurement(BOARD[:3], few.pixels[:, :3], few.seen[:, :3], few.stated[:, :3], few.weight[:, :3])
    found = lens_from_views(ASKED, [few])
    np.testing.assert_array_equal(found.parameters, guessed_lens(ASKED).parameters)
    np.testing.assert_array_equal(found.parameters, [1280, 1280, 639.5, 359.5, 0, 0, 0, 0, 0])


def test_few_views_of_a_strongly_distorted_lens():
    """Five real views of a wide lens give 5 % accuracy; all ten give 772 px.

    A lens without distortion would have 1126.
    """
    cell, recording = example("ur5e_dual")
    few = replace(recording, samples=tuple(s for s in recording.samples if s.sample in (1, 4, 5, 6, 9)))
    problem, _ = build_problem(cell, few)
    lens = lens_from_views(cell.cameras["camera"], [group.measurement for group in problem.groups])
    np.testing.assert_allclose(lens.focal, 772, rtol=0.05)


@pytest.mark.parametrize("focal", [1050.0, 1090.0])
def test_strong_distortion_is_not_taken_for_focal_length(focal):
    """Five views of a board give the focal length to a hundredth, though straight lines bend by several pixels."""
    distorted = Camera("pinhole", [focal, focal, 640.0, 360.0, -0.4, 0.04, 0.0, 0.0, 0.0], SIZE)
    np.testing.assert_allclose(lens_from_views(ASKED, [views(distorted, 0.3, 5)]).focal, focal, rtol=0.01)


def test_guess_is_centred_with_the_requested_width():
    """The principal point is in the middle of the pixel centres."""
    wide = guessed_lens(replace(ASKED, size_px=(641, 401)), 0.8)
    np.testing.assert_allclose(wide.parameters, [512.8, 512.8, 320, 200, 0, 0, 0, 0, 0])
    assert wide.size_px == (641, 401)


def test_lens_without_a_size_is_not_guessed():
    """The error about a lens without a size says what to state."""
    with pytest.raises(InputError, match="a free lens needs size_px"):
        guessed_lens(replace(ASKED, size_px=None))


@pytest.mark.parametrize(("count", "step"), [(30, 1), (31, 2), (60, 2), (61, 3)])
def test_at_most_thirty_views_of_four_points_are_kept(count, step):
    """Kept views are spread evenly, and each visible point has equal weight, whatever sigma was stated."""
    whole = views(lens(950.0), count=count + 2)
    seen = whole.seen.copy()
    seen[0, 3:], seen[1, 4:] = False, False  # three points, and four
    seen[-1] = False
    few = _thin_points(replace(whole, seen=seen, stated=7.0 * seen, weight=7.0 * seen))
    np.testing.assert_array_equal(few.pixels, whole.pixels[1:-1][::step])
    np.testing.assert_array_equal(few.weight, 1.0 * few.seen)
    np.testing.assert_array_equal(few.seen, seen[1:-1][::step])
    assert len(_thin_points(replace(whole, seen=np.zeros_like(seen))).seen) == 0


def test_poses_of_a_guess_use_its_valid_points():
    """Poses are exact if the lens is. Unseen pixels, or pixels without a direction, do not count."""
    fisheye = Camera("fisheye", [300.0, 300.0, 640.0, 360.0, 0.0, 0.0, 0.0, 0.0], SIZE)
    seen = views(fisheye, noise=0.0)
    pixels, mask = seen.pixels.copy(), seen.seen.copy()
    pixels[:, 3], mask[:, 3] = [100.0, 50.0], False
    pixels[:, 7] = [640.0 + 3.3 * 300, 360.0]  # beyond half a turn
    assert not fisheye.undistort(pixels)[1][:, 7].any()
    poses = _poses(fisheye, replace(seen, pixels=pixels, seen=mask, weight=1.0 * mask))
    at = (poses.rotation @ BOARD.T).swapaxes(1, 2) + poses.translation[:, None]
    others = np.setdiff1d(np.arange(len(BOARD)), [3, 7])
    np.testing.assert_allclose(fisheye.project(at)[:, others], seen.pixels[:, others], atol=1e-4)


def test_poses_are_eliminated_from_lens_equations(rng):
    """For two boards and two lenses, cost, gradient, Hessian, predicted decrease and step equal the explicit system."""
    boards = [views(lens(950.0), count=3), views(lens(950.0), noise=2.0, count=2)]
    lenses = [guessed_lens(ASKED, 0.7), lens(900.0)]
    state = stack([_Lenses(each, tuple(_poses(each, m) for m in boards)) for each in lenses])
    free = np.array([0, 2, 4])
    system = _BoardViews(boards, free)
    found = system.linearise(state)
    step = 1e-3 * rng.standard_normal((2, 3))
    after = system.retract(state, found, step)
    for k, each in enumerate(lenses):
        parts = [m.linearise(poses[k], each, True) for m, poses in zip(boards, state.poses, strict=True)]
        whole, force, at = np.zeros((33, 33)), np.zeros(33), 3
        for part in parts:
            for information, gradient in zip(part.information, part.gradient, strict=True):
                columns = np.concatenate([np.arange(at, at + 6), [0, 1, 2]])
                rows = np.concatenate([np.arange(6), 6 + free])
                whole[np.ix_(columns, columns)] += information[np.ix_(rows, rows)]
                force[columns] += gradient[rows]
                at += 6
        of_poses = np.linalg.inv(whole[3:, 3:])
        mixed = whole[:3, 3:]
        np.testing.assert_allclose(found.cost[k], sum(part.cost.sum() for part in parts))
        np.testing.assert_allclose(found.gradient[k], force[:3] - mixed @ of_poses @ force[3:], rtol=1e-6)
        np.testing.assert_allclose(found.hessian[k], whole[:3, :3] - mixed @ of_poses @ mixed.T, rtol=1e-6)
        np.testing.assert_allclose(found.eliminated_cost[k], force[3:] @ of_poses @ force[3:], rtol=1e-6)
        moved = (-of_poses @ (force[3:] + mixed.T @ step[k])).reshape(5, 6)
        steps = np.concatenate([(a[k].inverse() @ b[k]).log() for a, b in zip(state.poses, after.poses, strict=True)])
        np.testing.assert_allclose(steps, moved, rtol=1e-5, atol=1e-9)
        np.testing.assert_allclose(
            (after.camera.parameters - state.camera.parameters)[k], np.eye(9)[free].T @ step[k], atol=1e-9
        )
