"""Tests of the meeting of flanges, and of gauges shared by base and joints that it excludes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from tests.ends import end, views

from basecal.accuracy.task.meeting import (
    Meeting,
    choose_places,
    make_meeting,
    meeting_places,
    recorded_places,
    target_places,
    worst_meeting,
)
from basecal.estimation.problem.problem import Problem, Stops
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"
POINT = np.array([[0.5, 0.1, 0.3]])


@pytest.fixture(scope="module")
def arms():
    made = simulate(Scenario(samples=12, joints=True, joint_offset_rad=1e-3, joint_offsets="prior"), 3)
    return made, solve(made.cell, made.recording, Settings(robot_noise="stated"))


def test_gauge_of_base_and_first_joint_cancels(arms):
    """The hand's first joint rotated one way and its base the other leave the meeting flange in place."""
    made, solution = arms
    problem, state = solution.problem, solution.state
    flange = state.transforms[BASE] @ problem.groups[0].hand.base_from_flange.translation[:1]
    meeting = make_meeting(made.cell, problem, state, BASE, flange)
    step = np.zeros(problem.width)
    step[problem.columns[BASE].start + 5] = 1.0  # about z, as the first joint
    at_base = meeting.jacobian.values[0, :3] @ step[meeting.jacobian.columns]
    assert np.linalg.norm(at_base) > 0.3
    step[problem.columns[next(iter(problem.models["hand"].widths))].start] = -1.0
    both = meeting.jacobian.values[0] @ step[meeting.jacobian.columns]
    assert np.abs(both).max() < 1e-2


def test_meeting_weight_is_mean_square_over_places(arms):
    """The mean square is the average over places, by base and arms, plus the stops of both."""
    made, solution = arms
    each = [make_meeting(made.cell, solution.problem, solution.state, BASE, POINT + k * 0.1) for k in range(2)]
    places = np.concatenate([POINT, POINT + 0.1])
    both = make_meeting(made.cell, solution.problem, solution.state, BASE, places)
    alone = [meeting.mean_square_m2(solution.covariance) for meeting in each]
    assert both.mean_square_m2(solution.covariance) == pytest.approx(np.mean(alone))
    assert worst_meeting(each, solution.covariance) is each[int(np.argmax(alone))]
    errors = both.total_covariance(solution.covariance, [])
    assert np.mean(np.trace(errors[:, :3, :3], axis1=1, axis2=2)) == pytest.approx(np.mean(alone))


@pytest.mark.parametrize("size", [6, 3])
def test_point_moves_with_columns_of_its_transform(size):
    """A point's offset has three translation columns and no rotation."""
    covariance = np.diag(np.arange(1.0, 11.0))
    columns = {"a_from_b": slice(2, 2 + size), "c": slice(9, 10)}
    problem = Problem("a", (), {}, frozenset(), {}, Stops(np.zeros((0, 6))), columns)
    meeting = Meeting(problem, None, "a_from_b", "a", np.array([[0.0, 0.0, 2.0]]), {}, None)
    turns = 4 * (6 + 7) if size == 6 else 0
    assert np.trace(meeting.weight @ covariance) == pytest.approx(3 + 4 + 5 + turns)


def test_recorded_places_are_target_positions(arms):
    """Recorded places are the target positions of each view, in the reference's base."""
    _, solution = arms
    hand = solution.state.transforms[BASE] @ solution.problem.groups[0].hand.base_from_flange
    wanted = (hand @ solution.state.transforms["hand_flange_from_board"]).translation
    np.testing.assert_allclose(recorded_places(solution.problem, solution.state, BASE), wanted, atol=1e-12)


@pytest.mark.parametrize("based", [True, False])
@pytest.mark.parametrize("on_arm", [True, False])
def test_places_are_target_on_arm_or_camera(on_arm, based):
    """Places are those of the target on its arm, or of the camera, in the reference's base.

    The arm may have its own base.
    """
    rng = np.random.default_rng(1)
    base, mount, other = (SE3.exp(rng.standard_normal(6)) for _ in range(3))
    arm, world = SE3.exp(rng.standard_normal((3, 6))), SE3.identity((3,))
    moving = end("arm", arm, mount="mount", base="base" if based else None)
    still = end(None, world, mount="other")
    found = target_places(
        views(still, moving) if on_arm else views(moving, still),
        SimpleNamespace(transforms={"base": base, "mount": mount, "other": other}),
    )
    wanted = (base @ arm @ mount if based else arm @ mount).translation
    np.testing.assert_allclose(found, wanted, atol=1e-12)


def meeting_of(robots: tuple[str, ...], sigmas: list[list[float]], turned: SE3 | None = None) -> Meeting:
    """A meeting of arms a (the reference) and b without columns, with stops of these robots and sigmas."""
    stops = Stops(np.reshape(sigmas, (-1, 6)), robot=robots)
    state = SimpleNamespace(transforms={"a_from_b": turned})
    problem = Problem("a", (), {}, frozenset(), {}, stops, {"a_from_b": slice(0, 6)})
    places = {"a": np.zeros((1, 3)), "b": np.zeros((1, 3))}
    return Meeting(problem, state, "a_from_b", "a", np.zeros((1, 3)), places, None)


def test_stops_add_mean_variance():
    """Stops of each arm add the mean variance over stops and axes, of translation and rotation; exact arms add zero."""
    of = meeting_of(("a", "b", "a"), [[1, 2, 3, 4, 5, 6], [10] * 3 + [20] * 3, [0] * 6])
    np.testing.assert_allclose(of.stop_variance("a"), [14 / 6, 77 / 6])
    np.testing.assert_allclose(of.stop_variance("b"), [100, 400])
    np.testing.assert_array_equal(of.stop_variance("c"), [0, 0])
    assert of.stop_variances().keys() == {"a", "b"}
    assert of.mean_square_m2(np.zeros((6, 6))) == pytest.approx(3 * (14 / 6 + 100))
    assert of.mean_square_m2(np.diag([1.0, 2, 3, 0, 0, 0])) == pytest.approx(6 + 3 * (14 / 6 + 100))
    own = of.total_covariance(np.zeros((6, 6)), [np.array([1.0, 2.0]), np.array([3.0, 5.0])])
    np.testing.assert_allclose(own, [np.diag([4.0, 4, 4, 7, 7, 7])])


def test_reference_error_is_negated_and_rotated():
    """An error of the reference is negated and rotated to the axes of the other's base."""
    turned = SE3.from_rotvec([0, 0, np.pi / 2], [1.0, 2.0, 3.0])
    of = meeting_of((), [], turned)
    jacobian = np.arange(12.0).reshape(1, 6, 2)
    np.testing.assert_array_equal(of.propagate("b", jacobian), jacobian)
    found = of.propagate("a", jacobian)
    for half in (slice(0, 3), slice(3, 6)):
        np.testing.assert_allclose(found[0, half], -turned.rotation.T @ jacobian[0, half], atol=1e-12)


@pytest.mark.parametrize("count", [1, 59, 60, 61, 250])
def test_sixty_places_are_chosen_evenly(count):
    """Sixty places are chosen evenly with the first and last; of fewer, all are."""
    places = np.arange(3.0 * count).reshape(-1, 3)
    found = choose_places(places)
    rows = found[:, 0] / 3
    assert len(found) == min(count, 60)
    assert (rows[0], rows[-1]) == (0, count - 1)
    assert np.ptp(np.diff(rows), axis=0) <= 1 if count > 2 else True


def test_task_points_precede_recorded_places(monkeypatch):
    """Task points replace recorded places; without any, the recorded places are those of the task."""
    monkeypatch.setattr("basecal.accuracy.task.meeting.recorded_places", lambda *given: given)
    np.testing.assert_array_equal(meeting_places("problem", "state", "base", POINT), POINT)
    assert meeting_places("problem", "state", "base", POINT[:0]) == ("problem", "state", "base")
