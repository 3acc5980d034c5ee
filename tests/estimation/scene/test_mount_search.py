"""Tests of the search for a mount without a guess, and of its residuals with wrong recorded poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.scene import mount_search
from basecal.estimation.scene.mount_search import (
    MountStart,
    are_in_front,
    directions,
    find_mount,
    point_pairs,
    rotation_grid,
    sampson_px,
    scale_focal,
)
from basecal.geometry import SE3
from basecal.numerics.batch import take
from scene_points import LENS, MOUNT, looks_from_above, made_scene

PAIRS = 1500


@pytest.mark.journey
def test_mount_is_found_without_a_guess():
    """The mount is found to 5 mm and 0.5 deg by pairs alone, from a lens 8 % off. Distances are below two pixels."""
    scene = made_scene(1)
    parameters = LENS.parameters.copy()
    parameters[:2] *= 1.08
    found = find_mount(
        point_pairs(scene.tracks, PAIRS),
        scene.views.base_from_flange,
        LENS.with_parameters(parameters),
        True,
    )
    assert found is not None
    off = (MOUNT.inverse() @ found.flange_from_camera).log()
    assert np.linalg.norm(off[:3]) < 5e-3
    assert np.linalg.norm(off[3:]) < np.radians(0.5)
    assert found.lens.focal[0] == pytest.approx(LENS.focal[0], rel=0.01)
    assert found.median_px < 2.0


@pytest.mark.journey
@pytest.mark.parametrize("wrong", ["inverted", "shifted"])
def test_wrong_poses_leave_large_residuals(wrong):
    """Inverted poses, and poses of the previous sample, leave more than ten pixels."""
    scene = made_scene(2)
    poses = scene.views.base_from_flange
    order = np.roll(np.arange(len(poses)), 1)
    bad = poses.inverse() if wrong == "inverted" else poses[order]
    found = find_mount(point_pairs(scene.tracks, PAIRS), bad, LENS, True)
    assert found is not None
    assert found.median_px > 10.0


def test_too_few_pairs_give_no_mount():
    """With ten pairs of image points no mount is found."""
    scene = made_scene(3)
    pairs = point_pairs(scene.tracks, 10)
    assert len(pairs[0]) == 10
    assert find_mount(pairs, scene.views.base_from_flange, LENS, False) is None


def test_the_grid_covers_all_rotations():
    """No rotation is more than 20 deg from the grid of a thousand."""
    grid, rng = rotation_grid(1000), np.random.default_rng(0)
    any_rotation = np.linalg.qr(rng.standard_normal((300, 3, 3)))[0]
    any_rotation *= np.sign(np.linalg.det(any_rotation))[:, None, None]
    traces = np.einsum("nab,gab->ng", any_rotation, grid)
    nearest = np.degrees(np.arccos(np.clip((traces.max(1) - 1) / 2, -1, 1)))
    assert nearest.max() < 20.0


@pytest.mark.journey
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_points_are_in_front_of_the_camera(seed):
    """The search selects the solution with points in front.

    If views rotate about the vertical at one height, half a turn satisfies all epipolar lines, with its points behind.
    """
    scene = made_scene(seed, count=14, look=looks_from_above)
    found = find_mount(point_pairs(scene.tracks, PAIRS), scene.views.base_from_flange, LENS, False)
    assert found is not None
    assert found.front > 0.9
    assert np.linalg.norm((MOUNT.inverse() @ found.flange_from_camera).rotvec) < np.radians(1.0)


def test_distances_are_to_epipolar_lines():
    """Distances are zero for true poses and exact image points, and pixels for a mount 1 deg off."""
    scene = made_scene(4, noise=0.0)
    pairs = point_pairs(scene.tracks, 200)
    poses = scene.views.base_from_flange
    rays, focal_px = directions(pairs, LENS), float(LENS.focal.mean())
    assert np.abs(sampson_px(pairs, rays, poses, MOUNT, focal_px)).max() < 1e-6
    turned = MOUNT @ SE3.from_rotvec((np.radians(1.0), 0, 0), np.zeros(3))
    assert np.median(np.abs(sampson_px(pairs, rays, poses, turned, focal_px))) > 1.0


def test_pairs_share_a_point_and_a_camera():
    """Both image points of each pair show the same point, in two views of the camera."""
    scene = made_scene(5, arms=2)
    second = take(scene.tracks, scene.views.camera[scene.tracks.view] == 1)
    one, other = point_pairs(second, 300)
    assert len(one) == len(other) == 300
    assert np.all(scene.views.camera[one.view] == 1)
    assert np.all(scene.views.camera[other.view] == 1)
    assert np.all(one.view != other.view)
    known = {
        (int(v), *p): q
        for v, q, p in zip(scene.tracks.view, scene.tracks.point, scene.tracks.pixels.tolist(), strict=True)
    }
    assert all(
        known[int(i), *a] == known[int(j), *b]
        for i, j, a, b in zip(one.view, other.view, one.pixels.tolist(), other.pixels.tolist(), strict=True)
    )


def test_pairs_follow_the_views():
    """Pairs of a scene without its last views contain none of these."""
    scene = made_scene(6)
    kept, _ = scene.tracks.take(scene.tracks.view < 10)
    assert point_pairs(kept, 500)[1].view.max() < 10


def exact_pairs(seed=4):
    """A scene without noise, its pairs with their rays, and its poses."""
    scene = made_scene(seed, noise=0.0)
    pairs = point_pairs(scene.tracks, 200)
    return pairs, directions(pairs, LENS), scene.views.base_from_flange


def test_distances_equal_sampsons():
    """Distances are those of both image points from their epipolar lines, to first order.

    They are in pixels of the focal length.
    """
    pairs, rays, poses = exact_pairs()
    mount = MOUNT @ SE3.exp([2e-3, 0, 1e-3, 0.01, 0.02, -0.01])
    found = sampson_px(pairs, rays, poses, mount, 900.0)
    for k in range(0, 200, 25):
        one, other = (poses[int(each.view[k])] @ mount for each in pairs)
        between = one.inverse() @ other
        x, y = (each[k] / each[k, 2] for each in rays)
        essential = np.cross(between.translation, between.rotation, axisb=0, axisc=0)
        error = x @ essential @ y
        slope = np.hypot(*(essential @ y)[:2]) ** 2 + np.hypot(*(essential.T @ x)[:2]) ** 2
        assert abs(found[k]) == pytest.approx(900.0 * abs(error) / np.sqrt(slope))
    np.testing.assert_allclose(sampson_px(pairs, rays, poses, mount, 450.0), found / 2)


def test_true_rotation_has_the_true_position():
    """With exact pairs its sines are zero and its position is the camera's. A rotation 5 deg off has larger sines."""
    pairs, _, poses = exact_pairs()
    turned = MOUNT @ SE3.exp([0, 0, 0, np.radians(5), 0, 0])
    positions, sines = mount_search._score_rotations(pairs, poses, LENS, np.stack([MOUNT.rotation, turned.rotation]))
    np.testing.assert_allclose(positions[0], MOUNT.translation, atol=1e-5)
    assert sines[0] < 1e-7
    assert sines[1] > 1e-3


def test_wrong_pairs_are_down_weighted():
    """One pair in twenty shows different points, and the position is still the camera's to a millimetre."""
    (one, other), _, poses = exact_pairs()
    pixels = other.pixels.copy()
    pixels[::20] += (60.0, 80.0)
    pairs = one, replace(other, pixels=pixels)
    positions, _ = mount_search._score_rotations(pairs, poses, LENS, MOUNT.rotation[None])
    np.testing.assert_allclose(positions[0], MOUNT.translation, atol=1e-3)


def test_rays_meet_in_front_of_both_cameras():
    """Rays of true poses do. With the rays of either camera or both reversed, they do not."""
    pairs, (first, second), poses = exact_pairs()
    for one, other, is_front in ((1, 1, True), (-1, 1, False), (1, -1, False), (-1, -1, False)):
        found = are_in_front(pairs, (one * first, other * second), poses, MOUNT)
        assert found.all() if is_front else not found.any()


@pytest.mark.parametrize(("front", "is_behind"), [(0.49, True), (0.5, False), (1.0, False)])
def test_starts_behind_the_camera_come_last(front, is_behind):
    """The share of rays in front decides first, then the distance."""
    start = MountStart(MOUNT, LENS, 3.0, front)
    assert start.is_behind == is_behind
    worse, better = (MountStart(MOUNT, LENS, px) for px in (99.0, 2.0))
    assert sorted([start, worse, better], key=lambda each: each.misfit)[0] is better
    assert (start.misfit > worse.misfit) == is_behind


@pytest.mark.parametrize("count", [49, 50])
def test_search_needs_fifty_pairs(count):
    """With fifty pairs the mount is found from a guess, and with 49 it is not."""
    scene = made_scene(4, noise=0.0)
    pairs, poses = point_pairs(scene.tracks, count), scene.views.base_from_flange
    near = MOUNT @ SE3.exp([0.01, 0, -0.01, 0.02, 0, 0.02])
    found = find_mount(pairs, poses, LENS, False, near)
    assert (found is None) == (count == 49)
    if found is not None:
        assert np.linalg.norm((MOUNT.inverse() @ found.flange_from_camera).log()) < 1e-6
        np.testing.assert_array_equal(found.lens.parameters, LENS.parameters)
        assert found.median_px < 1e-6


def test_free_focal_length_is_estimated_from_a_guess():
    """The focal length is 8 % off, with exact pairs. The other lens parameters are unchanged."""
    pairs, _, poses = exact_pairs()
    near = MOUNT @ SE3.exp([0.01, 0, -0.01, 0.02, 0, 0.02])
    found = find_mount(pairs, poses, scale_focal(LENS, 1.08), True, near)
    assert found.lens.focal == pytest.approx([900.0, 900.0], rel=2e-3)
    np.testing.assert_array_equal(found.lens.parameters[2:], LENS.parameters[2:])


def test_number_of_pairs_is_limited():
    """With fewer, all are returned, and without tracks none.

    An image point is paired with the next one of its point.
    """
    scene = made_scene(5, count=4, points=20)
    every, _ = point_pairs(scene.tracks, 10**6)
    assert len(every) == len(scene.tracks) - scene.tracks.count
    assert [len(point_pairs(scene.tracks, most)[0]) for most in (1, 7, len(every))] == [1, 7, len(every)]
    none = take(scene.tracks, np.zeros(0, dtype=np.int64))
    assert len(point_pairs(none, 5)[0]) == 0


def test_rays_outside_a_lens_are_zero_in_both_images():
    """If one image point of a pair has no ray, the other has none either."""
    pairs, rays, _ = exact_pairs()
    folded = LENS.with_parameters(np.array([900.0, 900.0, 639.5, 359.5, -0.3, 0, 0, 0, 0]))
    pixels = np.full_like(pairs[0].pixels, 400.0)
    pixels[7] = (1400.0, 359.5)
    first, second = directions((replace(pairs[0], pixels=pixels), replace(pairs[1], pixels=0 * pixels + 300)), folded)
    for each in (first, second):
        assert np.flatnonzero(~each.any(axis=1)).tolist() == [7]
    assert np.linalg.norm(rays[0], axis=1) == pytest.approx(1.0)
