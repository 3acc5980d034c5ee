"""Tests of preparing views for a start: selection, conversion to directions or poses, and weights by ambiguity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.ends import end, views, with_hand

from basecal.cell.targets.points import points_target
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.correspondence import half_turn_views
from basecal.estimation.problem.problem import State
from basecal.estimation.start import pair_views as module
from basecal.estimation.start.pair_views import (
    _descend_readings,
    half_turn_mask,
    led_point,
    pair_views,
    umeyama,
)
from basecal.estimation.view.bearings import BearingMeasurement
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.estimation.view.view_pose import ViewPoses
from basecal.geometry import SE3, Camera
from basecal.geometry.rotation import rotation_exp
from basecal.simulation import Scenario, simulate


def prepare_views(scenario, views=100, points=100, seed=1, change=None):
    """Prepared views, the true poses of the target, and the group."""
    made = simulate(scenario, seed)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    group = group if change is None else change(group)
    truth = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6))).camera_from_target(group, problem.stops)
    return pair_views(group, made.cameras["wrist"], views, points), truth, group


def distance(candidates, truth):
    return np.abs((candidates[:, 0].inverse() @ truth).log()).max()


def test_measured_poses_are_their_own_candidates():
    """Both candidates are the measured pose, with full weight."""
    found, _, group = prepare_views(Scenario(samples=6, target="pose"))
    for k in (0, 1):
        np.testing.assert_array_equal(
            found.candidates[:, k].matrix, group.measurement.measured_camera_from_target.matrix
        )
    assert found.weight.tolist() == [1.0] * 6


def test_board_views_give_poses_and_directions():
    """The best candidate is the true pose to 1 cm and 0.01 rad, and directions point to the points."""
    found, truth, _ = prepare_views(Scenario(samples=8), points=9)
    assert distance(found.candidates, truth) < 0.01
    measurement = found.group.measurement
    assert isinstance(measurement, BearingMeasurement)
    assert len(measurement.points_in_target) == 9
    seen = truth.rotation[:, None] @ measurement.points_in_target[..., None]
    at = seen[..., 0] + truth.translation[:, None]
    unit = at / np.linalg.norm(at, axis=-1, keepdims=True)
    np.testing.assert_allclose(measurement.bearings_in_camera, unit, atol=2e-3)
    focal = simulate(Scenario(samples=8), 1).cameras["wrist"].focal.mean()
    np.testing.assert_allclose(measurement.weight, focal / 0.2)
    assert np.all((found.weight > 0.5) & (found.weight <= 1.0))


def test_ambiguous_views_have_less_weight():
    """For a small distant board, both poses of its plane fit, and its weight is a fifth at most."""
    near, _, _ = prepare_views(Scenario(samples=8, pixel_px=0.05))
    far, _, _ = prepare_views(Scenario(samples=8, pixel_px=5.0, distance_m=(0.85, 0.9), spread_rad=0.1))
    assert near.weight.min() > 0.5
    assert far.weight.min() < 0.2


def test_unstated_sigmas_count_as_half_a_pixel():
    """The sigma is needed for the weights of directions."""
    found, _, _ = prepare_views(Scenario(samples=5, state_pixel_noise=False))
    focal = simulate(Scenario(samples=5), 1).cameras["wrist"].focal.mean()
    np.testing.assert_allclose(found.group.measurement.weight, focal / 0.5)


@pytest.mark.parametrize("target", ["led", "points"])
def test_led_gives_directions_only(target):
    """One point has no candidate poses, five points have."""
    found, truth, _ = prepare_views(Scenario(samples=8, target=target))
    assert (found.candidates is None) == (target == "led")
    assert found.weight.shape == (8,)
    if target == "points":
        assert distance(found.candidates, truth) < 0.05


def test_3d_points_give_their_poses():
    """The pose is the rigid transform between the points. A single 3-D point is a direction."""
    found, truth, _ = prepare_views(Scenario(samples=6, target="points3d"))
    assert distance(found.candidates, truth) < 0.02

    def one_point(group):
        of = group.measurement
        first = slice(0, 1)
        return replace(
            group,
            measurement=replace(
                of,
                points_in_target=of.points_in_target[first],
                points_in_camera=of.points_in_camera[:, first],
                seen=of.seen[:, first],
                stated=of.stated[:, first],
                weight=of.weight[:, first],
            ),
        )

    alone, _, group = prepare_views(Scenario(samples=6, target="points3d"), change=one_point)
    assert alone.candidates is None
    at = group.measurement.points_in_camera
    np.testing.assert_allclose(
        alone.group.measurement.bearings_in_camera, at / np.linalg.norm(at, axis=-1, keepdims=True)
    )
    np.testing.assert_allclose(alone.group.measurement.weight, 1000.0)


def test_chessboard_is_read_from_one_end():
    """Views recorded from the other end are reversed so that all agree, and the other end's poses stay candidates.

    With each of the few points that are kept, the point at its place from the other end is kept, too.
    """

    def some_turned(group):
        turned = half_turn_views(group.measurement)
        pixels = np.where((np.arange(10) % 3 == 1)[:, None, None], turned.pixels, group.measurement.pixels)
        return replace(group, measurement=replace(group.measurement, pixels=pixels))

    found, truth, group = prepare_views(Scenario(samples=10, target="chessboard"), points=9, change=some_turned)
    assert found.candidates.shape == (10, 4)
    few = found.group.measurement.points_in_target
    assert len(few) == 10
    np.testing.assert_allclose(group.half_turn @ few, few[::-1], atol=1e-12)
    one, other = truth, truth @ group.half_turn
    assert min(distance(found.candidates, one), distance(found.candidates, other)) < 0.02
    back = found.candidates[:, 2:]
    assert min(distance(back, one), distance(back, other)) < 0.02


def test_loops_use_the_chosen_candidate():
    """Factors A and C are as recorded, B is the chosen candidate of each view, and X, Y, Z are the known ones."""
    found, _, group = prepare_views(Scenario(samples=5))
    x = SE3.exp(np.full(6, 0.1))
    loop = found.loop(x, None, None, np.array([0, 1, 0, 1, 0]))
    np.testing.assert_array_equal(loop.a.matrix, group.eye.base_from_flange.matrix)
    np.testing.assert_array_equal(loop.c.matrix, group.hand.base_from_flange.matrix)
    np.testing.assert_array_equal(loop.b.matrix[1], found.candidates[1, 1].matrix)
    np.testing.assert_array_equal(loop.b.matrix[2], found.candidates[2, 0].matrix)
    assert loop.unknown == "yz"
    light, _, _ = prepare_views(Scenario(samples=5, target="led"))
    np.testing.assert_array_equal(light.loop(None, None, None, np.zeros(5, int)).b.matrix, np.stack([np.eye(4)] * 5))


def test_umeyama_aligns_points(rng):
    """Exact points give the exact transform for any weights, and points of weight zero do not count."""
    points = rng.standard_normal((6, 3))
    true = SE3(rotation_exp(rng.standard_normal((3, 3))), rng.standard_normal((3, 3)))
    seen = (true.rotation @ points.T).swapaxes(1, 2) + true.translation[:, None]
    seen[:, 4] += 5.0
    weight = rng.uniform(0.5, 2.0, (3, 6))
    weight[:, 4] = 0.0
    np.testing.assert_allclose(umeyama(points, seen, weight).matrix, true.matrix, atol=1e-12)


def test_led_point_is_the_one_in_most_views():
    """Among three points, it is the one with the most weights."""
    weight = np.array([[0.1, 0.2, 0.0], [0.0, 0.3, 0.1]])
    measurement = BearingMeasurement(np.zeros((3, 3)), np.zeros((2, 3, 3)), weight)
    assert led_point(measurement) == (measurement, 1)


def test_partial_views_keep_enough_points():
    """Each view shows eight of 24 points of a body. Thinned to eight of its visible points, it still gives poses."""
    body = points_target(0.1 * np.random.default_rng(0).uniform(-1, 1, (24, 3)))
    made = simulate(Scenario(samples=12, target="points", board=body, pixel_px=0.1), 0)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    shown = np.arange(24) % 3 == (np.arange(12) % 3)[:, None]
    seen = group.measurement.seen & shown
    measurement = replace(group.measurement, seen=seen, weight=group.measurement.weight * seen)
    few = pair_views(replace(group, measurement=measurement), made.cameras["wrist"], 12, 8)
    assert few.candidates is not None
    assert len(few.group) == 12


def test_view_of_collinear_points_has_almost_no_weight():
    """A single column of a board has no pose: its information is singular, and by rounding even negative."""

    def of_a_line(group):
        seen = group.measurement.seen.copy()
        seen[3] &= np.isclose(group.measurement.points_in_target[:, 0], group.measurement.points_in_target[0, 0])
        weight = np.where(seen, group.measurement.weight, 0.0)
        return replace(group, measurement=replace(group.measurement, seen=seen, weight=weight))

    found, _, _ = prepare_views(Scenario(samples=20, target="charuco"), change=of_a_line)
    assert np.isfinite(found.weight).all()
    assert found.weight[3] < 0.01 * np.median(found.weight)


LENS = Camera("pinhole", [500.0, 700.0, 320.0, 240.0])


def group_of(measurement, count):
    """Views of an arm's camera at random flange poses."""
    flanges = SE3.exp(np.random.default_rng(0).standard_normal((count, 6)))
    return views(end("r", flanges, mount="x"), end(mount="z", base_from_flange=SE3.identity((count,))), measurement)


def pixels_of(seen, stated=None):
    """Pixels of points on a curve, some of them unseen, with 1 / sigma if stated."""
    n, p = seen.shape
    points = np.column_stack([np.linspace(0, 1, p), np.linspace(0, 1, p) ** 2, np.zeros(p)])
    pixels = np.random.default_rng(1).uniform(0, 600, (n, p, 2))
    stated = np.zeros((n, p)) if stated is None else stated
    return PixelMeasurement(points, pixels, seen, stated * seen, 1.0 * seen)


def poses_with(cost, sigma_rad=0.02):
    """A function that returns poses of these costs, each with this total sigma in radians."""
    cost = np.array(cost, dtype=np.float64)
    poses = SE3.exp(np.random.default_rng(2).standard_normal((*cost.shape, 6)))
    information = np.tile(np.diag([1e6] * 3 + [3 / sigma_rad**2] * 3), (len(cost), 1, 1))
    return lambda *_: ViewPoses(poses, cost, information)


def test_pose_weight_depends_on_sigma_and_ambiguity():
    """The weight is half at 0.02 rad, and a fifth of that if ambiguous.

    Two poses are ambiguous if their costs differ by less than five sigmas, 25.
    """
    group = group_of(pixels_of(np.ones((4, 6), dtype=bool)), 4)
    cost = [[0.0, 24.9], [0.0, 25.1], [10.0, 34.9], [10.0, 36.0]]
    for sigma_rad, half in ((0.02, 0.5), (0.06, 0.25)):
        found = pair_views(group, LENS, 9, 9, poses_with(cost, sigma_rad))
        np.testing.assert_allclose(found.weight, half * np.array([0.2, 1.0, 0.2, 1.0]), rtol=1e-6)


@pytest.mark.parametrize(("none", "kept"), [([], [0, 1, 2, 3]), ([1], [0, 2, 3]), ([1, 2], None)])
def test_views_without_a_pose_are_left_out(none, kept):
    """The others keep their poses. If fewer than three views have a pose, all views are used as directions."""
    cost = np.array([[0.0, 30.0]] * 4)
    cost[none] = np.inf
    poses_of = poses_with(cost)
    found = pair_views(group_of(pixels_of(np.ones((4, 6), dtype=bool)), 4), LENS, 9, 9, poses_of)
    assert found.group.sample.tolist() == (kept or [0, 1, 2, 3])
    assert len(found.weight) == len(found.group) == len(found.group.measurement.weight)
    assert found.total == 4
    if kept is None:
        assert found.candidates is None
        assert found.weight.tolist() == [1.0] * 4
    else:
        np.testing.assert_array_equal(found.candidates.matrix, poses_of().camera_from_target.matrix[kept])


@pytest.mark.parametrize(("points", "has_poses"), [(3, False), (4, True)])
def test_target_of_four_points_has_poses(points, has_poses):
    """A target of four points has poses, and one of three has none, whatever their cost."""
    found = pair_views(group_of(pixels_of(np.ones((3, points), dtype=bool)), 3), LENS, 9, 9, poses_with([[0, 30]] * 3))
    assert (found.candidates is not None) == has_poses


def test_directions_have_stated_or_default_weights():
    """Weights are per radian by the mean focal length, with half a pixel if unstated.

    Unseen points have neither weight nor direction.
    """
    seen = np.array([[True, True, False]] * 2)
    group = group_of(pixels_of(seen, np.array([[0.5, 0.0, 0.5]] * 2)), 2)
    of = pair_views(group, LENS, 9, 9).group.measurement
    np.testing.assert_allclose(of.weight, np.array([[0.5, 2.0, 0.0]] * 2) * 600)
    np.testing.assert_allclose(of.bearings_in_camera[:, :2], LENS.undistort(group.measurement.pixels)[0][:, :2])
    assert not of.bearings_in_camera[:, 2].any()


@pytest.mark.parametrize(("total", "views", "kept"), [
    (5, 1, [0]),
    (5, 2, [0, 4]),
    (6, 3, [0, 2, 5]),
    (3, 3, [0, 1, 2]),
    (3, 4, [0, 1, 2]),
    (20, 5, [0, 5, 10, 14, 19]),
])  # fmt: skip
def test_selected_views_are_spread_from_first_to_last(total, views, kept):
    """Selected views are spread from the first to the last, and a single view is the first."""
    poses, weight = SE3.identity((total,)), np.ones((total, 6))
    found = pair_views(group_of(PoseMeasurement(poses, weight, weight), total), None, views, 9)
    assert found.group.sample.tolist() == kept
    assert found.total == total


@pytest.mark.parametrize(
    ("shown", "most", "left"), [([12, 12, 24], 6, 12), ([24, 24, 24], 6, 6), ([0, 0, 150], 1, 150)]
)
def test_partly_visible_targets_keep_more_points(shown, most, left):
    """A target is thinned such that the median view shows the requested number of points.

    If it shows none, all of hundreds are kept.
    """
    count = max(shown)
    group = group_of(pixels_of(np.arange(count) < np.array(shown)[:, None]), 3)
    assert len(pair_views(group, LENS, 9, most).group.measurement.points_in_target) == left


@pytest.mark.parametrize(("extent", "seen", "kept"), [
    ((1, 1, 1), [3, 3, 3, 2], [0, 1, 2]),
    ((1, 1, 0), [3, 4, 5, 5], [0, 1, 2, 3]),
    ((1, 1, 1), [3, 3, 2, 2], None),
    ((1, 0, 0), [5, 5, 5, 5], None),
])  # fmt: skip
def test_three_points_in_space_give_a_pose_unless_collinear(rng, extent, seen, kept):
    """Three points that are not collinear give a pose in space.

    At least three such views are needed, else all views are used as directions.
    """
    points, poses = rng.standard_normal((5, 3)) * extent, SE3.exp(rng.standard_normal((4, 6)))
    at = (poses.rotation @ points.T).mT + poses.translation[:, None]
    mask = np.arange(5) < np.array(seen)[:, None]
    found = pair_views(group_of(PointMeasurement(points, at, mask, 1.0 * mask, 1.0 * mask), 4), None, 9, 9)
    assert found.group.sample.tolist() == (kept or [0, 1, 2, 3])
    assert found.weight.tolist() == [1.0] * len(found.group)
    if kept is None:
        assert found.candidates is None
        np.testing.assert_array_equal(found.group.measurement.weight, 1000.0 * mask)
    else:
        for k in (0, 1):
            np.testing.assert_allclose(found.candidates[:, k].matrix, poses.matrix[kept], atol=1e-9)


@pytest.mark.parametrize("flip", [[False, True, True], [False, False, False]])
def test_views_from_the_other_end_are_reversed_completely(monkeypatch, flip):
    """Directions and weights are reversed, and the poses of that end come first. Each end's best pose decides."""
    target_from_turned = SE3(np.diag([-1.0, -1.0, 1.0]), np.array([0.2, 0.1, 0.0]))
    asked = []

    def half_turn_mask(group, read, turned):
        asked.append((read, turned))
        return np.array(flip)

    monkeypatch.setattr(module, "half_turn_mask", half_turn_mask)
    measurement, poses_of = pixels_of(np.arange(6) < np.array([[6], [5], [4]])), poses_with([[0.0, 30.0]] * 3)
    group = replace(group_of(measurement, 3), half_turn=target_from_turned)
    found, plain = (
        pair_views(group, LENS, 9, 6, poses_of),
        pair_views(replace(group, half_turn=None), LENS, 9, 6, poses_of),
    )
    own = poses_of().camera_from_target
    ends = own, own @ target_from_turned
    np.testing.assert_array_equal(asked[0], [end.rotation[:, 0] for end in ends])
    for view, is_flipped in enumerate(flip):
        first, second = (ends[k][view].matrix for k in (is_flipped, not is_flipped))
        np.testing.assert_allclose(found.candidates[view].matrix, np.concatenate([first, second]))
        order = slice(None, None, -1 if is_flipped else 1)
        for name in ("bearings_in_camera", "weight"):
            of = getattr(plain.group.measurement, name)[view, order]
            np.testing.assert_array_equal(getattr(found.group.measurement, name)[view], of)


def test_closest_pose_has_the_smaller_rotation(rng):
    """The rotation is relative to the prediction of X, Y and Z, whatever the translation."""
    group = group_of(PoseMeasurement(SE3.identity((3,)), np.ones((3, 6)), np.ones((3, 6))), 3)
    triple = tuple(SE3.exp(rng.standard_normal(6)) for _ in "xyz")
    turns = np.array([[0.1, 0.2], [0.4, 0.3], [2.0, -1.0]])
    sight = module.PairViews(group, SE3.identity((3, 2)), np.ones(3), 3)
    predicted = sight.group.close_loop(*triple)
    expected = (group.eye.base_from_flange @ triple[0]).inverse() @ triple[1] @ triple[2]
    np.testing.assert_allclose(predicted.matrix, expected.matrix, atol=1e-12)
    off = SE3.from_rotvec(turns[..., None] * [0.0, 0.6, 0.8], rng.standard_normal((3, 2, 3)))
    assert replace(sight, candidates=predicted[:, None] @ off).closest_pose(triple).tolist() == [0, 1, 1]


def test_both_poses_of_ambiguous_views_are_samples(rng):
    """Each view has its better pose, followed by the other poses of ambiguous views.

    Without ambiguous views none are added.
    """
    group = group_of(PoseMeasurement(SE3.identity((3,)), np.ones((3, 6)), np.ones((3, 6))), 3)
    sight = module.PairViews(group, SE3.exp(rng.standard_normal((3, 2, 6))), np.array([1.0, 0.2, 0.9]), 3)
    loop = sight.loop(None, None, None, np.zeros(3, dtype=np.int64))
    assert sight.ambiguous_loop(loop) is None
    both = replace(sight, is_ambiguous=np.array([False, True, False])).ambiguous_loop(loop)
    np.testing.assert_array_equal(both.b.matrix[:3], sight.candidates.matrix[:, 0])
    np.testing.assert_array_equal(both.b.matrix[3:], sight.candidates.matrix[1:2, 1])
    np.testing.assert_array_equal(both.a.matrix[3], loop.a.matrix[1])
    np.testing.assert_array_equal(both.weight, [1.0, 0.2, 0.9, 0.2])


HALF_TURN = np.diag([-1.0, -1.0, 1.0])


@pytest.mark.parametrize("count", [4, 12])
def test_half_turns_are_found_for_any_arm_rotation(count):
    """One arm rotates by up to 3 rad, with poses off by 5 mrad, and all views are read from the same end."""
    s = simulate(Scenario(samples=count, arms="eye_still"), 2)
    (group,) = build_problem(s.cell, s.recording)[0].groups
    rng = np.random.default_rng(0)
    # The target rotates as far as its arm, about other axes.
    wide = rotation_exp(rng.uniform(-1.7, 1.7, (count, 3)))
    turned_group = with_hand(group, base_from_flange=_rotate_flanges(group, wide))
    mount = rotation_exp(np.array([0.3, -0.2, 2.0]))
    read = np.swapaxes(mount, -1, -2) @ wide @ mount @ rotation_exp(5e-3 * rng.standard_normal((count, 3)))
    flipped = rng.random(count) < 0.5
    seen = np.where(flipped[:, None, None], read @ HALF_TURN, read)
    found = half_turn_mask(turned_group, seen, seen @ HALF_TURN)
    assert np.array_equal(found, flipped) or np.array_equal(found, ~flipped)


def _rotate_flanges(group, rotation):
    return type(group.hand.base_from_flange)(rotation, group.hand.base_from_flange.translation)


def group_by_stops(eye_stand, hand_stand, eye, hand):
    """Views of two arms with these stop numbers and flange rotations."""
    n = len(eye_stand)
    a, c = (SE3(np.broadcast_to(turn, (n, 3, 3)), np.zeros((n, 3))) for turn in (eye, hand))
    return views(end("eye", a, stop_number=eye_stand), end("hand", c, stop_number=hand_stand))


def rotation_about(angle_rad, axis=(0.6, 0.0, 0.8)):
    return rotation_exp(np.multiply.outer(angle_rad, axis))


@pytest.mark.parametrize("stands", [([0, 1, 2, 3], [0, 1, 2, 3]), ([0, 0, 0, 0], [0, 0, 0, 0])])
def test_half_turns_minimise_rotation_if_no_robot_moved_alone(stands):
    """If both robots moved between any two views, or neither did, the target's rotation is unknown.

    Views are then read with the smallest rotation from the first.
    """
    wide = rotation_about([0.0, 1.0, 1.7, 3.0], (0.0, 0.0, 1.0))
    found = half_turn_mask(group_by_stops(*stands, wide, rotation_about([0.0, 0.1, 0.2, 0.3])), wide, wide @ HALF_TURN)
    assert found.tolist() == [False, False, True, True]


@pytest.mark.parametrize("still", ["eye", "hand"])
def test_arm_that_moved_alone_determines_the_half_turns(still):
    """Either arm may be the moving one. It rotates by 3 rad, for which the other end is nearer to the first view."""
    angle = np.array([0.0, 3.0, 2.5, 0.4, 2.0])
    moved, stood = rotation_about(angle, (0.0, 0.0, 1.0)), np.eye(3)
    stands, turns = ([0] * 5, [0, 1, 2, 3, 4]), (stood, moved)
    seen = moved if still == "eye" else moved.mT
    if still == "hand":
        stands, turns = stands[::-1], turns[::-1]
    found = half_turn_mask(group_by_stops(*stands, *turns), seen, seen @ HALF_TURN)
    assert found.tolist() in ([False] * 5, [True] * 5)
    flipped = np.array([False, True, False, True, True])
    mixed = np.where(flipped[:, None, None], seen @ HALF_TURN, seen)
    found = half_turn_mask(group_by_stops(*stands, *turns), mixed, mixed @ HALF_TURN)
    assert found.tolist() in (flipped.tolist(), (~flipped).tolist())


@pytest.mark.parametrize("count", [2, 3, 7])
def test_readings_are_optimal_for_each_single_view(rng, count):
    """At the end of the descent, changing the reading of a single view does not reduce the cost.

    The start is not modified, and an end is kept.
    """
    misfit = rng.uniform(size=(count, 2, count, 2))
    misfit = misfit + misfit.transpose(2, 3, 0, 1)
    misfit[np.arange(count), :, np.arange(count)] = 0.0
    rows, begun = np.arange(count), rng.integers(0, 2, count)
    start = begun.copy()

    def cost(turn):
        return misfit[rows, turn][:, rows, turn].sum()

    found = _descend_readings(misfit, begun)
    np.testing.assert_array_equal(begun, start)
    assert cost(found) <= cost(begun)
    for view in rows:
        other = np.where(rows == view, 1 - found, found)
        assert cost(other) >= cost(found) - 4e-6
    np.testing.assert_array_equal(_descend_readings(misfit, found), found)
