"""Tests of reporting excluded items, with their distance from the prediction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.ends import with_eye, with_hand

from basecal.estimation.outliers import left_out
from basecal.estimation.outliers.classify import classify_inliers
from basecal.estimation.outliers.inlier_mask import InlierMask, all_inliers
from basecal.estimation.outliers.left_out import measure_left_out_items
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.correspondence import half_turn_views
from basecal.estimation.problem.problem import State
from basecal.estimation.view.contacts import GripMeasurement, PlaneMeasurement
from basecal.estimation.view.points import TouchMeasurement
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def cell_at_truth(scenario, seed=0):
    made = simulate(scenario, seed)
    problem, _ = build_problem(made.cell, made.recording)
    return made.cell, problem, State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))


def bump_hand(problem, view, by):
    (group,) = problem.groups
    off = np.zeros((len(group), 6))
    off[view] = by
    return problem.with_groups([with_hand(group, base_from_flange=group.hand.base_from_flange @ SE3.exp(off))])


def measure_excluded(cell, problem, state, views=(), points=(), recorded=None):
    """The excluded items for these views and pairs of view and point."""
    mask = all_inliers(problem)
    of_views, of_points = mask.views[0].copy(), mask.points[0].copy()
    of_views[list(views)] = False
    for view, point in points:
        of_points[view, point] = False
    kept = InlierMask((of_views,), (of_points,))
    judgement = classify_inliers(problem, state, kept)
    return measure_left_out_items(cell, recorded or problem, problem, state, kept, judgement)


def test_empty_list_without_excluded_items():
    """If all views and points are kept, the list of excluded items is empty."""
    assert measure_excluded(*cell_at_truth(Scenario(samples=4))) == ()


@pytest.mark.parametrize("target", ["charuco", "pose", "points3d"])
def test_view_with_a_pose_is_off_in_metres_and_radians(target):
    """A hand 50 mm and 20 mrad off is reported within the noise of the view, without pixels."""
    cell, problem, state = cell_at_truth(Scenario(samples=8, target=target, pose_noise=(1e-4, 1e-4), point_m=1e-4))
    (one,) = measure_excluded(cell, bump_hand(problem, 5, [0.05, 0, 0, 0, 0, 0.02]), state, [5])
    assert (one.sample, one.camera, one.target, one.ids) == (5, "wrist", "board", ())
    board = state.transforms["hand_flange_from_board"].translation
    lever = np.linalg.norm(SE3.exp([0.05, 0, 0, 0, 0, 0.02]) @ board - board)
    assert one.off_m == pytest.approx(lever, abs=2e-3)
    assert one.off_rad == pytest.approx(0.02, abs=3e-3)
    assert one.off_px is None
    assert one.sigmas > 50


def test_led_is_off_in_pixels():
    """A spot 30 px right and 40 px down is 50 px off. Behind the camera, the distance is not finite."""
    cell, problem, state = cell_at_truth(Scenario(samples=12, target="led"))
    (group,) = problem.groups
    pixels = group.measurement.pixels.copy()
    pixels[3, 0] += (30.0, 40.0)
    moved = problem.with_groups([replace(group, measurement=replace(group.measurement, pixels=pixels))])
    (one,) = measure_excluded(cell, moved, state, [3])
    assert (one.sample, one.off_m, one.off_rad) == (3, None, None)
    assert one.off_px == pytest.approx(50.0, abs=1.5)
    mount, turned = state.transforms["eye_flange_from_wrist"], SE3.from_rotvec([0, np.pi, 0], [0, 0, 0])
    eye = [p @ mount @ turned @ mount.inverse() if k == 3 else p for k, p in enumerate(group.eye.base_from_flange)]
    away = problem.with_groups([with_eye(group, base_from_flange=SE3.stack(eye))])
    (one,) = measure_excluded(cell, away, state, [3])
    assert not np.isfinite(one.off_px)


def test_three_points_give_no_pose():
    """A view with three visible corners is off by its worst pixel, one with four by its pose."""
    cell, problem, state = cell_at_truth(Scenario(samples=8))
    (group,) = bump_hand(problem, [2, 5], [0.03, 0, 0, 0, 0, 0]).groups
    seen = group.measurement.seen.copy()
    seen[2, [k for k in range(36) if k not in (0, 5, 30)]] = False
    seen[5, [k for k in range(36) if k not in (0, 5, 30, 35)]] = False
    weight = np.where(seen, group.measurement.weight, 0.0)
    few = replace(group.measurement, seen=seen, weight=weight, stated=weight)
    three, four = measure_excluded(cell, problem.with_groups([replace(group, measurement=few)]), state, [2, 5])
    assert (three.off_m, four.off_px) == (None, None)
    assert 10 < three.off_px < 200
    assert four.off_m == pytest.approx(0.03, abs=3e-3)


def test_three_3d_points_give_a_pose_and_two_a_shift():
    """Distances of clean views are within their noise of 0.1 mm.

    Three 3-D points give a pose, and two give only a shift.
    """
    cell, problem, state = cell_at_truth(Scenario(samples=8, target="points3d", point_m=1e-4))
    (group,) = problem.groups
    seen = group.measurement.seen.copy()
    count = seen.shape[1]
    seen[2, 2:] = False
    seen[5, [k for k in range(count) if k not in (0, 1, count - 1)]] = False
    weight = np.where(seen, group.measurement.weight, 0.0)
    few = replace(group.measurement, seen=seen, weight=weight, stated=weight)
    two, three = measure_excluded(cell, problem.with_groups([replace(group, measurement=few)]), state, [2, 5])
    assert two.off_rad is None
    assert two.off_m < 5e-4
    assert two.off_px is None
    assert three.off_m < 0.01


def test_points_are_reported_with_the_worst_of_them():
    """Two corners of one view are 10 and 25 px off, at 0.2 px noise: both ids, the worst in pixels and sigmas."""
    cell, problem, state = cell_at_truth(Scenario(samples=6))
    (group,) = problem.groups
    pixels = group.measurement.pixels.copy()
    pixels[4, 7] += (6.0, -8.0)
    pixels[4, 3] += (-15.0, 20.0)
    moved = problem.with_groups([replace(group, measurement=replace(group.measurement, pixels=pixels))])
    (one,) = measure_excluded(cell, moved, state, points=[(4, 7), (4, 3)])
    ids = cell.targets["board"].target.ids
    assert (one.sample, one.ids) == (4, tuple(sorted((int(ids[3]), int(ids[7])))))
    assert one.off_px == pytest.approx(25.0, abs=0.8)
    assert one.sigmas == pytest.approx(25.0 / 0.2, rel=0.05)
    assert (one.off_m, one.off_rad) == (None, None)


def test_3d_points_are_off_in_metres():
    """A corner 20 mm off is reported in metres, at a noise of a tenth of a millimetre."""
    cell, problem, state = cell_at_truth(Scenario(samples=6, target="points3d", point_m=1e-4))
    (group,) = problem.groups
    points = group.measurement.points_in_camera.copy()
    points[1, 2] += (0.0, 0.02, 0.0)
    moved = problem.with_groups([replace(group, measurement=replace(group.measurement, points_in_camera=points))])
    (one,) = measure_excluded(cell, moved, state, points=[(1, 2)])
    assert one.off_m == pytest.approx(0.02, abs=2e-3)
    assert one.off_px is None


def test_points_of_excluded_views_are_not_reported():
    """Only the view is reported, and items are in the order of samples."""
    cell, problem, state = cell_at_truth(Scenario(samples=6))
    found = measure_excluded(cell, problem, state, views=[4], points=[(4, 1), (5, 0), (2, 0)])
    assert [(o.sample, bool(o.ids)) for o in found] == [(2, True), (4, False), (5, True)]


def test_ids_are_those_of_the_recording():
    """A view read from the opposite end has its point ids counted from the recorded end."""
    cell, problem, state = cell_at_truth(Scenario(samples=4, target="chessboard"))
    (group,) = problem.groups
    turned = half_turn_views(group.measurement)
    pixels = np.where((np.arange(4) == 2)[:, None, None], turned.pixels, group.measurement.pixels)
    recorded = problem.with_groups([replace(group, measurement=replace(group.measurement, pixels=pixels))])
    found = measure_excluded(cell, problem, state, points=[(1, 0), (2, 0)], recorded=recorded)
    ids = cell.targets["board"].target.ids
    assert [o.ids for o in found] == [(int(ids[0]),), (int(ids[-1]),)]


def test_sigmas_use_the_scale_of_views_and_points():
    """Items have half of the sigmas with four times the view variance.

    Points have a third with nine times the point variance.
    """
    cell, problem, state = cell_at_truth(Scenario(samples=6))
    (group,) = problem.groups
    pixels = group.measurement.pixels.copy()
    pixels[4, 7] += (6.0, -8.0)
    problem = bump_hand(
        problem.with_groups([replace(group, measurement=replace(group.measurement, pixels=pixels))]),
        2,
        [0.05] + [0] * 5,
    )
    mask = all_inliers(problem)
    points = mask.points[0].copy()
    points[4, 7] = False
    kept = InlierMask((np.arange(6) != 2,), (points,))
    judgement = classify_inliers(problem, state, kept)
    plain = measure_left_out_items(cell, problem, problem, state, kept, judgement)
    wider = replace(
        judgement,
        view_scale=replace(judgement.view_scale, variance=4.0 * judgement.view_scale.variance),
        point_scale=replace(judgement.point_scale, variance=9.0 * judgement.point_scale.variance),
    )
    found = measure_left_out_items(cell, problem, problem, state, kept, wider)
    assert [of.sample for of in found] == [2, 4]
    assert [one.sigmas / other.sigmas for one, other in zip(found, plain, strict=True)] == pytest.approx([1 / 2, 1 / 3])
    assert plain[0].sigmas == pytest.approx(np.sqrt(judgement.views[0].value[2] / judgement.view_scale.variance))
    assert found[1].off_px == plain[1].off_px


@pytest.mark.parametrize(("kept", "by_view"), [(2, False), (3, True), (30, True)])
def test_point_distance_is_to_its_own_view(kept, by_view):
    """With three or more kept points, their own pose predicts the others. Otherwise all else predicts them."""
    _, problem, state = cell_at_truth(Scenario(samples=2, pixel_px=1e-3))
    (group,) = problem.groups
    true, lens = state.camera_from_target(group, problem.stops), state.cameras["wrist"]
    off = true @ SE3.exp([0.004, 0.0, 0.0, 0.0, 0.0, 0.0])
    used = np.zeros((2, 36), dtype=bool)
    used[:, [0, 5, 30, *range(6, 30), 31, 32, 33][:kept]] = True
    weight = group.measurement.weight.copy()
    weight[0, 35] = 0.0
    found = left_out._distances(replace(group.measurement, weight=weight), used, off, lens)
    moved = np.linalg.norm(
        lens.project(off[:, None] @ group.measurement.points_in_target) - group.measurement.pixels, axis=-1
    )
    seen = group.measurement.seen & (weight > 0)
    if by_view:
        assert np.abs(found[seen]).max() < 0.3
    else:
        np.testing.assert_allclose(found[seen], moved[seen], rtol=1e-6)


@pytest.mark.parametrize(
    ("kind", "off_m"), [(TouchMeasurement, 0.005), (PlaneMeasurement, 0.004), (GripMeasurement, None)]
)
def test_contact_distance_is_in_metres_for_positions(kind, off_m):
    """A tip is 5 mm from its mark, 4 mm of them along its z axis. Directions of a grip have no length."""
    _, problem, state = cell_at_truth(Scenario(samples=2))
    (group,) = problem.groups
    ones, zeros = np.ones((2, 1)), np.zeros((2, 1, 3))
    contact = kind(np.zeros((1, 3)), zeros, ones > 0, ones, ones)
    near = SE3.exp(np.tile([0.003, 0.0, 0.004, 0.0, 0.0, 0.0], (2, 1)))
    one = left_out._left_out_view(replace(group, measurement=contact), state, near, 1, 7.0)
    assert (one.sample, one.ids, one.sigmas) == (int(group.sample[1]), (), 7.0)
    assert one.off_m == (None if off_m is None else pytest.approx(off_m))
    assert one.off_rad is None


@pytest.mark.parametrize("target", ["chessboard", "charuco", "points3d"])
def test_only_symmetric_grids_are_counted_from_either_end(target):
    """Only chessboards that look equal from both ends have their ids reversed, and other targets keep their ids."""
    _, problem, _ = cell_at_truth(Scenario(samples=3, target=target))
    (group,) = problem.groups
    measurement, ids = group.measurement, np.arange(group.measurement.seen.shape[1])
    np.testing.assert_array_equal(left_out._ids_by_view(ids, group, group), np.tile(ids, (3, 1)))
    name = "pixels" if hasattr(measurement, "pixels") else "points_in_camera"
    moved = getattr(measurement, name).copy()
    moved[1] += 1.0
    other = replace(group, measurement=replace(measurement, **{name: moved}))
    found = left_out._ids_by_view(ids, other, group)
    np.testing.assert_array_equal(found[1], ids[::-1] if target == "chessboard" else ids)
    np.testing.assert_array_equal(found[[0, 2]], np.tile(ids, (2, 1)))
