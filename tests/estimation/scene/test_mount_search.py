"""A mount is found without a guess, and recorded poses that are wrong leave many pixels."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.scene.mount_search import directions, find_mount, point_pairs, rotation_grid, sampson_px
from basecal.geometry import SE3
from basecal.numerics.batch import take
from scene_points import LENS, MOUNT, looks_from_above, made_scene

PAIRS = 1500


def test_a_mount_is_found_without_a_guess():
    """To 5 mm and 0.5 deg by pairs alone, from a lens 8 % off; distances are below two pixels."""
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


@pytest.mark.parametrize("wrong", ["inverted", "shifted"])
def test_wrong_poses_leave_many_pixels(wrong):
    """Inverted poses, and poses of the sample before, leave more than ten pixels."""
    scene = made_scene(2)
    poses = scene.views.base_from_flange
    order = np.roll(np.arange(len(poses)), 1)
    bad = poses.inverse() if wrong == "inverted" else poses[order]
    found = find_mount(point_pairs(scene.tracks, PAIRS), bad, LENS, True)
    assert found is not None
    assert found.median_px > 10.0


def test_too_few_pairs_give_no_mount():
    """With ten pairs nothing is found."""
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


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_points_are_in_front_of_the_camera(seed):
    """Of views that turn about the vertical at one height, half a turn fits all epipolar lines, its points behind."""
    scene = made_scene(seed, count=14, look=looks_from_above)
    found = find_mount(point_pairs(scene.tracks, PAIRS), scene.views.base_from_flange, LENS, False)
    assert found is not None
    assert found.front > 0.9
    assert np.linalg.norm((MOUNT.inverse() @ found.flange_from_camera).rotvec) < np.radians(1.0)


def test_distances_are_those_to_epipolar_lines():
    """Of true poses and image points without noise they are zero, of a mount 1 deg off they are pixels."""
    scene = made_scene(4, noise=0.0)
    pairs = point_pairs(scene.tracks, 200)
    poses = scene.views.base_from_flange
    rays, focal_px = directions(pairs, LENS), float(LENS.focal.mean())
    assert np.abs(sampson_px(pairs, rays, poses, MOUNT, focal_px)).max() < 1e-6
    turned = MOUNT @ SE3.from_rotvec((np.radians(1.0), 0, 0), np.zeros(3))
    assert np.median(np.abs(sampson_px(pairs, rays, poses, turned, focal_px))) > 1.0


def test_pairs_are_of_one_point_and_one_camera():
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


def test_views_of_another_order_are_other_pairs():
    """Pairs follow the views: those of a scene without its last views have none of these."""
    scene = made_scene(6)
    kept, _ = scene.tracks.take(scene.tracks.view < 10)
    assert point_pairs(kept, 500)[1].view.max() < 10
