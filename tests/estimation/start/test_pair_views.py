"""Views made ready for a start: few of them, as directions or poses, trusted as far as they are clear."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell.targets.points import points_target
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.correspondence import half_turned
from basecal.estimation.problem.problem import State
from basecal.estimation.start.pair_views import as_light, pair_views, umeyama
from basecal.estimation.view.bearings import BearingMeasurement
from basecal.geometry import SE3
from basecal.geometry.rotation import rotation_exp
from basecal.simulation import Scenario, simulate


def prepared(scenario, views=100, points=100, seed=1, change=None):
    """Views made ready, the poses of the target that are true, and the group they are of."""
    made = simulate(scenario, seed)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    group = group if change is None else change(group)
    truth = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6))).camera_from_target(group, problem.stops)
    return pair_views(group, made.cameras["wrist"], views, points), truth, group


def off(candidates, truth):
    return np.abs((candidates[:, 0].inverse() @ truth).log()).max()


def test_views_are_thinned_evenly():
    """Five of twenty, first and last among them; the total is that before."""
    found, _, group = prepared(Scenario(samples=20, target="pose"), views=5)
    assert found.group.sample.tolist() == group.sample[[0, 5, 10, 14, 19]].tolist()
    assert found.total == 20
    assert len(prepared(Scenario(samples=4, target="pose"), views=5)[0].group) == 4


def test_measured_poses_are_their_own_candidates():
    """Both of them, fully trusted."""
    found, _, group = prepared(Scenario(samples=6, target="pose"))
    for k in (0, 1):
        np.testing.assert_array_equal(
            found.candidates[:, k].matrix, group.measurement.measured_camera_from_target.matrix
        )
    assert found.weight.tolist() == [1.0] * 6


def test_a_boards_views_give_poses_and_directions():
    """The best candidate is the true pose to a centimetre and radian; directions are where the points are."""
    found, truth, _ = prepared(Scenario(samples=8), points=9)
    assert off(found.candidates, truth) < 0.01
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


def test_views_that_look_alike_from_two_sides_are_trusted_less():
    """A small board far off: both poses of its plane fit, and its weight is a fifth at most."""
    near, _, _ = prepared(Scenario(samples=8, pixel_px=0.05))
    far, _, _ = prepared(Scenario(samples=8, pixel_px=5.0, distance_m=(0.85, 0.9), spread_rad=0.1))
    assert near.weight.min() > 0.5
    assert far.weight.min() < 0.2


def test_unstated_sigmas_count_as_half_a_pixel():
    """So that directions have weights."""
    found, _, _ = prepared(Scenario(samples=5, state_pixel_noise=False))
    focal = simulate(Scenario(samples=5), 1).cameras["wrist"].focal.mean()
    np.testing.assert_allclose(found.group.measurement.weight, focal / 0.5)


@pytest.mark.parametrize("target", ["led", "points"])
def test_a_light_gives_directions_alone(target):
    """No candidates from one point; from five points there are."""
    found, truth, _ = prepared(Scenario(samples=8, target=target))
    assert (found.candidates is None) == (target == "led")
    assert found.weight.shape == (8,)
    if target == "points":
        assert off(found.candidates, truth) < 0.05


def test_two_views_of_a_board_are_taken_as_directions():
    """Three views at least have to give a pose."""
    assert prepared(Scenario(samples=2))[0].candidates is None
    assert prepared(Scenario(samples=3))[0].candidates is not None


def test_3d_points_give_their_poses():
    """By the rotation that brings them together; a single point in 3-D is a direction."""
    found, truth, _ = prepared(Scenario(samples=6, target="points3d"))
    assert off(found.candidates, truth) < 0.02

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

    alone, _, group = prepared(Scenario(samples=6, target="points3d"), change=one_point)
    assert alone.candidates is None
    at = group.measurement.points_in_camera
    np.testing.assert_allclose(
        alone.group.measurement.bearings_in_camera, at / np.linalg.norm(at, axis=-1, keepdims=True)
    )
    np.testing.assert_allclose(alone.group.measurement.weight, 1000.0)


def test_a_chessboard_is_read_from_one_end():
    """Views recorded from the other end are turned so that all agree; the other end's poses stay candidates.

    With each of the few points that are kept goes the one at its place from the other end.
    """

    def some_turned(group):
        turned = half_turned(group.measurement)
        pixels = np.where((np.arange(10) % 3 == 1)[:, None, None], turned.pixels, group.measurement.pixels)
        return replace(group, measurement=replace(group.measurement, pixels=pixels))

    found, truth, group = prepared(Scenario(samples=10, target="chessboard"), points=9, change=some_turned)
    assert found.candidates.shape == (10, 4)
    few = found.group.measurement.points_in_target
    assert len(few) == 10
    np.testing.assert_allclose(group.half_turn @ few, few[::-1], atol=1e-12)
    one, other = truth, truth @ group.half_turn
    assert min(off(found.candidates, one), off(found.candidates, other)) < 0.02
    back = found.candidates[:, 2:]
    assert min(off(back, one), off(back, other)) < 0.02


def test_loops_take_the_chosen_candidate():
    """Factors A and C as recorded, B the candidate that was chosen for each view, X, Y, Z as known."""
    found, _, group = prepared(Scenario(samples=5))
    x = SE3.exp(np.full(6, 0.1))
    loop = found.loop(x, None, None, np.array([0, 1, 0, 1, 0]))
    np.testing.assert_array_equal(loop.a.matrix, group.eye_base_from_eye_flange.matrix)
    np.testing.assert_array_equal(loop.c.matrix, group.hand_base_from_hand_flange.matrix)
    np.testing.assert_array_equal(loop.b.matrix[1], found.candidates[1, 1].matrix)
    np.testing.assert_array_equal(loop.b.matrix[2], found.candidates[2, 0].matrix)
    assert loop.unknown == "yz"
    light, _, _ = prepared(Scenario(samples=5, target="led"))
    np.testing.assert_array_equal(light.loop(None, None, None, np.zeros(5, int)).b.matrix, np.stack([np.eye(4)] * 5))


def test_umeyama_brings_points_together(rng):
    """Exact points give the exact transform whatever their weights, and points of no weight do not count."""
    points = rng.standard_normal((6, 3))
    true = SE3(rotation_exp(rng.standard_normal((3, 3))), rng.standard_normal((3, 3)))
    seen = (true.rotation @ points.T).swapaxes(1, 2) + true.translation[:, None]
    seen[:, 4] += 5.0
    weight = rng.uniform(0.5, 2.0, (3, 6))
    weight[:, 4] = 0.0
    np.testing.assert_allclose(umeyama(points, seen, weight).matrix, true.matrix, atol=1e-12)


def test_a_light_of_several_points_is_the_one_most_views_see():
    """Of three points the one with the most weights."""
    weight = np.array([[1.0, 2.0, 0.0], [0.0, 3.0, 1.0]])
    measurement = BearingMeasurement(np.zeros((3, 3)), np.zeros((2, 3, 3)), weight)
    assert as_light(measurement) == (measurement, 1)


def test_views_that_show_a_part_of_the_target_keep_enough_of_it():
    """Each view shows eight of 24 points of a body: thinned to eight of what it shows they still give poses."""
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


def test_a_view_of_points_in_a_line_counts_next_to_nothing():
    """A column of a board alone holds no pose: its information is singular, and by rounding even negative."""

    def of_a_line(group):
        seen = group.measurement.seen.copy()
        seen[3] &= np.isclose(group.measurement.points_in_target[:, 0], group.measurement.points_in_target[0, 0])
        weight = np.where(seen, group.measurement.weight, 0.0)
        return replace(group, measurement=replace(group.measurement, seen=seen, weight=weight))

    found, _, _ = prepared(Scenario(samples=20, target="charuco"), change=of_a_line)
    assert np.isfinite(found.weight).all()
    assert found.weight[3] < 0.01 * np.median(found.weight)
