"""Tests of plans for a task: their sample counts and their predicted errors."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Calibration, MeetingError, PixelObservation, Recording, RobotState, Sample, TouchObservation
from basecal.errors import InputError
from basecal.geometry import SE3, PoseEstimate
from basecal.planning import plan as plans
from basecal.planning.plan import (
    MOST_SAMPLES,
    OUTLOOK_COUNTS,
    _calibrated_meeting,
    _Goal,
    _make_goal,
    _order_samples,
    _steps,
    _taught_states,
    choose_best,
    draw_offers,
    outlook,
    plan_for_task,
    plan_stations,
)
from basecal.planning.prospects import sketches
from basecal.planning.shifts import STATION_SAMPLES
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"


@pytest.fixture(scope="module")
def cell():
    made = simulate(Scenario(samples=12, robot_noise=(1e-4, 2e-4)), 3)
    bare = Recording(tuple(Sample(s.sample, robots=s.robots) for s in made.recording.samples))
    point = (made.truth[BASE].translation / 2)[None]
    return made.cell, made.recording, bare, calibrate(made.cell, made.recording), point


@pytest.fixture(scope="module")
def tolerance_plan(cell):
    """Plan for 0.6 mm without a recording."""
    described, _, bare, calibration, point = cell
    return plan_for_task(described, bare, calibration, point, tolerance_m=6e-4)


def test_tolerance_is_reached_with_needed_samples(tolerance_plan):
    """All of the samples are needed, none has an observation, and they are numbered after the recording."""
    assert tolerance_plan.reachable is True
    assert tolerance_plan.needed == len(tolerance_plan.samples) > 0
    assert tolerance_plan.expected_m <= 6e-4 * 1.001
    assert [sample.sample for sample in tolerance_plan.samples] == list(range(12, 12 + tolerance_plan.needed))
    assert not any(sample.observations for sample in tolerance_plan.samples)
    assert sum(entry.share for entry in tolerance_plan.budget) == pytest.approx(1.0, rel=1e-2)


@pytest.mark.journey
def test_recorded_samples_reduce_the_plan(cell, tolerance_plan):
    """Fewer samples are needed in addition to a recording, and none if the recording suffices."""
    described, recording, _, calibration, point = cell
    beside = plan_for_task(described, recording, calibration, point, tolerance_m=6e-4)
    assert beside.recorded == 12
    assert beside.needed < tolerance_plan.needed
    enough = plan_for_task(described, recording, calibration, point, tolerance_m=0.1)
    assert (enough.needed, enough.samples, enough.reachable) == (0, (), True)


@pytest.mark.journey
def test_unreachable_tolerance_is_reported(cell):
    """A micrometre is unreachable with the maximal number of samples.

    The budget lists the sources, the largest first.
    """
    described, _, bare, calibration, point = cell
    found = plan_for_task(described, bare, calibration, point, tolerance_m=1e-6)
    assert (found.reachable, found.needed, len(found.samples)) == (False, None, MOST_SAMPLES)
    shares = [entry.share for entry in found.budget]
    assert shares == sorted(shares, reverse=True)


@pytest.mark.journey
def test_requested_count_is_planned(cell):
    """The plan has the requested number of samples, with or without a tolerance. More samples give a smaller error."""
    described, _, bare, calibration, point = cell
    twelve = plan_for_task(described, bare, calibration, point, count=12)
    assert (len(twelve.samples), twelve.needed, twelve.reachable) == (12, None, None)
    both = plan_for_task(described, bare, calibration, point, tolerance_m=6e-4, count=20)
    assert len(both.samples) == 20 != both.needed
    assert both.expected_m < twelve.expected_m


def test_plan_requires_a_taught_pose(cell):
    """An empty recording is refused with a message that states what to do."""
    described, _, _, calibration, point = cell
    with pytest.raises(InputError, match="taught poses"):
        plan_for_task(described, Recording(()), calibration, point, tolerance_m=1e-3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"points_m": np.zeros((2, 2))}, r"^points_m has shape \(2, 2\), expected"),
        ({"points_m": np.zeros(3)}, r"^points_m has shape \(3,\), expected finite \(n, 3\)$"),
        ({"points_m": np.full((1, 3), np.nan)}, "expected finite"),
        ({"tolerance_m": np.nan}, r"^tolerance_m is nan, expected a length above zero \[m\]$"),
        ({"tolerance_m": -1e-3}, "above zero"),
        ({"tolerance_m": 0.0}, "above zero"),
        ({"tolerance_m": np.inf}, "above zero"),
        ({"count": 2.5}, r"^count is 2\.5, expected a whole number >= 0$"),
        ({"seed": -1}, "^seed is -1"),
        ({"group_size": 0}, "^group_size is 0"),
        ({"offers": []}, "^offers is empty"),
    ],
)
def test_invalid_task_is_refused(cell, options, message):
    """A NaN or a negative tolerance is refused rather than planned."""
    described, recording, _, calibration, point = cell
    with pytest.raises(InputError, match=message):
        plan_for_task(described, recording, calibration, **{"points_m": point, "count": 2, **options})


def meeting(variance_m2, stops_m2=0.0):
    """A meeting at one point whose error per axis has the variance of the first column times a factor, and stops'."""

    def total_covariance(covariance, stops):
        total = variance_m2 * covariance[0, 0] + sum(float(place) for place, _ in stops)
        return total * np.eye(6)[None]

    return SimpleNamespace(
        weight=variance_m2 * np.eye(2),
        total_covariance=total_covariance,
        stop_variances=lambda: {"eye": (stops_m2, 0.0)},
        mean_square_m2=lambda covariance: 3 * variance_m2 * covariance[0, 0],
    )


QUANTILE = np.sqrt(7.8147)  # 95 % of a chi-square of three degrees of freedom


def test_expected_error_is_that_of_worst_meeting():
    """The expected error is the 95 % quantile of the length, including the variance of the stops.

    The criterion is the sum of all meetings.
    """
    goal = _Goal((meeting(1e-6), meeting(4e-6, 5e-6)), 1.0, 0, None, 0.0)
    assert goal.expected_m(np.eye(2), 0) == pytest.approx(3e-3 * QUANTILE, rel=1e-3)
    assert goal.expected_m(0.25 * np.eye(2), 9) == pytest.approx(np.sqrt(6e-6) * QUANTILE, rel=1e-3)
    np.testing.assert_allclose(goal.weight, 5e-6 * np.eye(2))


def test_excess_variance_decreases_with_samples():
    """The variance beyond the noise is shared by all samples.

    Without additional samples the expected error is the calibration's own.
    """
    now = MeetingError(7e-3, "task points", 2e-3)
    goal = _Goal((meeting(1e-6),), 1.0, 10, now, 9e-6)
    assert (goal.excess_m2(0), goal.excess_m2(10), goal.excess_m2(20)) == pytest.approx((9e-6, 4.5e-6, 3e-6))
    assert goal.expected_m(np.eye(2), 0) == 7e-3
    assert goal.expected_m(np.eye(2), 20) == pytest.approx(np.sqrt(2) * 1e-3 * QUANTILE, rel=1e-3)
    assert _Goal((meeting(1e-6),), 1.0, 0, None, 9e-6).excess_m2(0) == 0.0


def test_calibrated_error_is_used_at_its_own_points():
    """The error of a calibration at other points is not used."""
    now = MeetingError(7e-3, "task points", 2e-3)
    known = Calibration("good", {}, meeting=now, settings={"task_point": [0.1, 0.2, 0.3]})
    assert _calibrated_meeting(known, np.array([[0.1, 0.2, 0.3]])) is now
    assert _calibrated_meeting(known, np.array([[0.1, 0.2, 0.4]])) is None
    assert _calibrated_meeting(known, np.zeros((0, 3))) is None
    assert _calibrated_meeting(replace(known, settings={}), np.zeros((0, 3))) is now


@pytest.mark.parametrize("recorded", [frozenset(), frozenset({1, 2, 3})])
@pytest.mark.parametrize("calibrated", [True, False])
def test_goal_starts_at_recorded_error(monkeypatch, recorded, calibrated):
    """The initial error is the calibration's, of which the noise in use may explain a part.

    Without recorded samples there is none.
    """
    now = MeetingError(7e-3, "task point", 2e-3)
    known = Calibration("good", {}, meeting=now, settings={"task_point": [0.1, 0.2, 0.3]}) if calibrated else None
    points = np.array([[0.1, 0.2, 0.3]])
    places = []
    monkeypatch.setattr(plans, "require_placed_transforms", lambda cell: ("base",))
    monkeypatch.setattr(plans, "meeting_places", lambda problem, state, name, at: at)
    monkeypatch.setattr(plans, "make_meeting", lambda *given: places.append(given[-1]) or meeting(1e-6))
    prospect = SimpleNamespace(
        problem="all", state=None, covariance=np.eye(2), recorded=recorded, recorded_problem="recorded"
    )
    goal = _make_goal(prospect, None, known, points)
    assert (goal.tolerance_m, goal.recorded) == (np.inf, len(recorded))
    assert goal.current_error is (now if calibrated and recorded else None)
    assert goal.unexplained_m2 == pytest.approx(12e-6 - 3e-6 if goal.current_error else 0.0)
    assert _make_goal(prospect, None, known, points, 5e-4).tolerance_m == 5e-4
    prospect.covariance = 100 * prospect.covariance
    assert _make_goal(prospect, None, known, points).unexplained_m2 == 0.0
    assert all(each is points for each in places)
    if not recorded:
        with pytest.raises(InputError, match="name a task point"):
            _make_goal(prospect, None, known, np.zeros((0, 3)))
    else:
        assert _make_goal(prospect, None, known, np.zeros((0, 3))).current_error is None


def test_best_candidates_are_chosen_and_counted():
    """Of independent roots the largest are chosen. Errors after each group are counted in samples."""
    roots = np.array([1.0, 3.0, 2.0, 0.5])[:, None, None] * np.array([[1.0], [0.0]])
    prospect = SimpleNamespace(covariance=np.eye(2))
    for count, best, information in ((1, {1}, 10), (2, {1, 2}, 14), (3, {0, 1, 2}, 15)):
        chosen, covariance = choose_best(prospect, roots, np.eye(2), count)
        assert set(chosen) == best
        np.testing.assert_allclose(covariance, np.diag([1 / information, 1.0]))
    goal = _Goal((meeting(1e-6),), 1.0, 0, None, 0.0)
    found = _steps(goal, np.eye(2), roots[[1, 2]], 7)
    assert [count for count, _ in found] == [0, 7, 14]
    wanted = 1e-3 * QUANTILE * np.sqrt([1, 1 / 10, 1 / 14])
    np.testing.assert_allclose([error for _, error in found], wanted, rtol=1e-3)


def test_outlook_starts_at_the_calibration(cell, monkeypatch):
    """Counts beyond the number of candidates are omitted, and more samples reduce the error."""
    described, recording, _, calibration, point = cell
    monkeypatch.setattr(plans, "OUTLOOK_CANDIDATES", 11)
    steps = outlook(described, recording, replace(calibration, settings={"task_point": point[0].tolist()}), point)
    assert [count for count, _ in steps] == [0, 5, 10]
    assert steps[0][1] == calibration.meeting.expected_95_m
    assert steps[0][1] > steps[1][1] > steps[2][1]


def test_candidates_are_divided_among_observed_views(cell, monkeypatch):
    """Each observed view has its share, rounded up.

    Views without feasible candidates are omitted, and it is an error if all are.
    """
    described, recording, bare, calibration, _ = cell
    (sketch,) = sketches(described, calibration)
    given = []

    def draw(each, states, count, seed):
        if "none" in given:
            raise InputError("nothing is feasible")
        given.append((len(states), count, seed))
        return [each]

    monkeypatch.setattr(plans, "candidates", draw)
    assert [view for view, _ in draw_offers([sketch, sketch, sketch], recording, 10, 5)] == [sketch] * 3
    assert given == [(12, 4, 5)] * 3
    given.clear()
    assert len(draw_offers([sketch], bare, 10)) == 1
    assert given == [(12, 10, 0)]
    given.append("none")
    with pytest.raises(InputError, match="nothing is feasible"):
        draw_offers([sketch, sketch], recording, 10)


def test_taught_states_see_the_target(cell):
    """Taught states are those that observed the target, else those from which it is visible, else all."""
    described, recording, bare, calibration, _ = cell
    (sketch,) = sketches(described, calibration)
    blind = [
        Sample(s.sample, robots={n: RobotState(r.base_from_flange.inverse()) for n, r in s.robots.items()})
        for s in bare.samples
    ]
    states = [dict(s.robots) for s in recording.samples]
    assert _taught_states(sketch, [recording.samples[0], *bare.samples[1:]]) == states[:1]
    assert _taught_states(sketch, [*blind[:2], *bare.samples[2:]]) == states[2:]
    assert _taught_states(sketch, blind) == [dict(s.robots) for s in blind]


def test_planned_samples_are_numbered_with_touches_only(cell):
    """Groups that must stay together keep their order, other samples of one arm are sorted by number.

    Only touches are kept as observations.
    """
    described, recording, _, calibration, _ = cell
    (sketch,) = sketches(described, calibration)
    touch, view = TouchObservation("tip", "mark"), PixelObservation("wrist", "board", np.arange(4), np.zeros((4, 2)))
    eye = {"eye": RobotState(SE3.identity())}
    samples = tuple(Sample(20 + k, robots=eye, observations=(touch, view)) for k in range(4))
    prospect = SimpleNamespace(samples=samples)
    for may_part, order in ((True, [1, 3]), (False, [3, 1])):
        states = [{"eye": RobotState(SE3(np.eye(3), np.array([k, 0.0, 0.0])))} for k in range(4)]
        prospect.samples = tuple(replace(s, robots=r) for s, r in zip(samples, states, strict=True))
        found = _order_samples(sketch, prospect, recording, [3, 1], may_part)
        assert [each.sample for each in found] == [20, 21]
        assert [each.robots["eye"].base_from_flange.translation[0] for each in found] == order
        assert all(each.observations == (touch,) for each in found)
    assert _order_samples(sketch, prospect, recording, [], True) == ()


def test_complete_stations_are_offered(cell, monkeypatch):
    """The stations are those of the first view, at its taught states."""
    described, recording, _, calibration, point = cell
    given = []
    monkeypatch.setattr(plans, "draw_offers", lambda known, taught, count, seed: [(known[0], [])])
    monkeypatch.setattr(plans, "stations", lambda sketch, states, seed: given.append((len(states), seed)) or "stations")
    monkeypatch.setattr(plans, "plan_for_task", lambda *words, **more: (words, more))
    words, more = plan_stations(described, recording, calibration, point, 1e-3, 14, 5)
    assert given == [(12, 5)]
    assert words == (described, recording, calibration, point, 1e-3, 14, 5)
    assert more["group_size"] == STATION_SAMPLES
    assert [offered for _, offered in more["offers"]] == ["stations"]


@pytest.mark.slow
def test_three_robots_are_planned_together():
    """Both pairs of a chain of three robots without observations are planned, and both bases are then known."""
    made = simulate(Scenario(samples=6, layout="chain", robots=3, robot_noise=(1e-4, 2e-4)), 3)
    bare = Recording(tuple(Sample(s.sample, robots=s.robots) for s in made.recording.samples))
    guessed = Calibration("doubtful", {name: PoseEstimate(mean, np.eye(6)) for name, mean in made.truth.items()})
    found = plan_for_task(made.cell, bare, guessed, np.array([[0.5, 0.0, 0.3]]), count=16)
    assert len(found.samples) == 16
    assert found.expected_m is not None
    assert found.expected_m < 5e-3
    taught = [sample.robots["r3"].base_from_flange for sample in bare.samples]
    moved = [s.robots["r3"].base_from_flange not in taught for s in found.samples]
    assert 0 < sum(moved) < 16


@pytest.mark.slow
def test_only_offered_candidates_are_chosen(cell):
    """If candidates are offered, only these are chosen."""
    described, _, bare, calibration, point = cell
    offered = draw_offers(sketches(described, calibration), bare, 30)
    found = plan_for_task(described, bare, calibration, point, count=8, offers=offered)
    places = [sample.robots["hand"].base_from_flange.translation.tolist() for sample in offered[0][1]]
    assert all(sample.robots["hand"].base_from_flange.translation.tolist() in places for sample in found.samples)


@pytest.mark.slow
def test_outlook_decreases_with_samples(cell):
    """Errors decrease with planned samples, beginning at that of the recording.

    Those of the last count are below half of it.
    """
    described, recording, _, calibration, point = cell
    steps = outlook(described, recording, calibration, point)
    assert [count for count, _ in steps] == list(OUTLOOK_COUNTS)
    lengths = [length for _, length in steps]
    assert lengths == sorted(lengths, reverse=True)
    now = plan_for_task(described, recording, calibration, point, tolerance_m=1.0)
    assert lengths[0] == pytest.approx(now.expected_m, rel=0.02)
    assert lengths[-1] < 0.5 * lengths[0]


@pytest.mark.slow
def test_shift_stations_are_planned_for_a_task(cell):
    """Complete stations are planned, each with a still camera. More of them give a smaller error."""
    described, _, bare, calibration, point = cell
    found = [plan_stations(described, bare, calibration, point, count=count) for count in (28, 42)]
    assert [len(plan.samples) for plan in found] == [28, 42]
    for at in range(0, 42, STATION_SAMPLES):
        station = found[1].samples[at : at + STATION_SAMPLES]
        assert len({sample.robots["eye"].base_from_flange.translation.tobytes() for sample in station}) == 1
        assert (
            len({sample.robots["hand"].base_from_flange.translation.tobytes() for sample in station}) == STATION_SAMPLES
        )
    assert found[1].expected_m < found[0].expected_m


def test_plan_stations_passes_plan_defaults(cell, monkeypatch):
    """Stations have no default tolerance or count, and the same default seed as other plans."""
    described, recording, _, calibration, point = cell
    given = []
    monkeypatch.setattr(plans, "draw_offers", lambda known, taught, *more: given.append(more) or [(known[0], [])])
    monkeypatch.setattr(plans, "stations", lambda sketch, states, seed: given.append(seed))
    monkeypatch.setattr(plans, "plan_for_task", lambda *words, **more: words)
    assert plan_stations(described, recording, calibration, point)[4:] == (None, None, 0)
    assert given == [(1, 0), 0]


def test_first_view_is_planned_without_observations(cell, monkeypatch):
    """Without observations the first view with taught poses is planned."""
    described, _, bare, calibration, _ = cell
    known = sketches(described, calibration)[0]
    board = described.targets[known.target.name]
    seen = replace(described, targets={"board": board, "second": replace(board, name="second")})
    views = [replace(known, cell=seen, view=("wrist", name)) for name in ("board", "second")]
    monkeypatch.setattr(plans, "is_in_view", lambda sketch, sample: False)
    monkeypatch.setattr(plans, "candidates", lambda sketch, states, count, seed: [(len(states), count, seed)])
    assert [(sketch.view[1], found) for sketch, found in draw_offers(views, bare, 9)] == [("board", [(12, 9, 0)])]
    monkeypatch.setattr(plans, "is_in_view", lambda sketch, sample: sketch.view[1] == "second")
    assert [(sketch.view[1], found) for sketch, found in draw_offers(views, bare, 9, 2)] == [("second", [(12, 9, 2)])]
    monkeypatch.setattr(plans, "is_in_view", lambda sketch, sample: True)
    shares = [(sketch.view[1], found[0][1]) for sketch, found in draw_offers(views, bare, 9)]
    assert shares == [("board", 5), ("second", 5)]


def test_budget_includes_excess_variance(monkeypatch):
    """The budget is that of the worst meeting, with the excess variance of the planned number of samples."""
    monkeypatch.setattr(plans, "worst_meeting", lambda meetings, covariance: meetings[1])
    monkeypatch.setattr(plans, "budget", lambda solution, meeting, total_m2, known: (meeting.name, total_m2, known))
    meetings = [SimpleNamespace(name=name, mean_square_m2=lambda of: 3.0 * of) for name in ("a", "b")]
    goal = SimpleNamespace(meetings=meetings, excess_m2=lambda count: 1.0 / count)
    assert plans._budget(SimpleNamespace(covariance=2.0), goal, 4) == ("b", 6.25, {})


def test_choice_of_zero_samples_is_empty():
    """A choice of zero samples is empty, and the covariance is unchanged."""
    prior = np.diag([2.0, 3.0])
    chosen, covariance = plans.choose_best(SimpleNamespace(covariance=prior), np.ones((3, 2, 1)), np.eye(2), 0)
    assert chosen == []
    np.testing.assert_array_equal(covariance, prior)
