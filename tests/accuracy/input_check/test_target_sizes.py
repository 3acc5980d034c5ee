"""The size that a target would have to have."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.ends import end, views
from tests.simulated_problem import simulated_problem

from basecal.accuracy.input_check import target_sizes
from basecal.accuracy.input_check.hypotheses import resized
from basecal.accuracy.input_check.loop_fit import LoopFit
from basecal.accuracy.input_check.rewriting import scaled, with_targets
from basecal.accuracy.input_check.target_sizes import (
    _by_translations,
    _factor,
    _parabola,
    _refined,
    _Sized,
    _spread,
    as_written,
    size_hypotheses,
    target_size,
)
from basecal.cell import Unknown
from basecal.errors import BasecalError
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


@pytest.mark.parametrize("target", ["charuco", "points3d", "pose"])
@pytest.mark.parametrize("factor", [0.9, 1.2])
def test_the_factor_is_found(target, factor):
    """A target stated too large by a factor is found smaller by it, within a hundredth; so are poses further away."""
    made = simulate(Scenario(samples=15, target=target, pose_noise=(2e-4, 5e-4)), 0)
    cell, recording = made.cell, made.recording
    if target == "pose":
        recording = with_targets(recording, scaled(factor))
    else:
        cell = resized(cell, {"board": factor})
    (reading,) = size_hypotheses(cell, recording, made.cameras, solve(cell, recording).state)
    found = float(reading.words.split("is ")[1].split(" times")[0])
    assert found * factor == pytest.approx(1.0, abs=0.01)


def test_a_light_has_no_size():
    """A single point gives no size to find."""
    made = simulate(Scenario(samples=15, target="led", camera_mount="fixed"), 0)
    assert size_hypotheses(made.cell, made.recording, made.cameras, solve(made.cell, made.recording).state) == []


def test_resizing_keeps_what_it_is_not_about():
    """Points are multiplied, and a target of another name stays."""
    cell = simulate(Scenario(samples=1), 0).cell
    other = replace(cell.targets["board"], name="other")
    cell = replace(cell, targets={**cell.targets, "other": other})
    told = resized(cell, {"board": 2.0})
    np.testing.assert_array_equal(told.targets["board"].target.points, 2 * cell.targets["board"].target.points)
    assert told.targets["other"] is other


@pytest.mark.parametrize(
    ("target", "said"),
    [
        ("charuco", "square_m would be 0.06"),
        ("aprilgrid", "tag_m would be 0.084"),
        ("circles", "spacing_m would be 0.06"),
    ],
)
def test_the_true_size_is_said_in_the_targets_own_field(target, said):
    """What to do names the field of cell.yaml that gives a board its size, of whatever kind it is."""
    cell = simulate(Scenario(target=target, samples=1, pixel_px=0.0), 0).cell
    (name,) = cell.targets
    assert said in target_size(name, 2.0, cell).fix


@pytest.mark.parametrize("target", ["charuco", "points3d"])
def test_the_right_size_is_not_searched_for_another(target):
    """Nothing would be gained, nor by a size off by a thousandth beside noise of robots."""
    made = simulate(Scenario(samples=12, target=target), 0)
    assert size_hypotheses(made.cell, made.recording, made.cameras, solve(made.cell, made.recording).state) == []
    noisy = simulate(Scenario(samples=12, target=target, robot_noise=(1e-3, 2e-3)), 0)
    cell = resized(noisy.cell, {"board": 1.001})
    assert size_hypotheses(cell, noisy.recording, noisy.cameras, solve(cell, noisy.recording).state) == []


def test_near_the_stated_size_the_vertex_of_the_parabola_is_the_size():
    """Of a board stated 1.5 % too large or small it is found to a thirtieth, and gains nearly all squares."""
    for factor in (0.985, 1.015):
        made = simulate(Scenario(samples=8), 0)
        cell = resized(made.cell, {"board": factor})
        gain, vertex = _parabola(_Sized(cell, made.recording, "board"), solve(cell, made.recording).state)
        assert gain > 0.7
        assert vertex == pytest.approx(-np.log(factor), rel=1 / 30)


def test_a_spread_is_about_the_points_mean():
    """Wherever a target's points are written from."""
    points = np.random.default_rng(0).normal(size=(6, 3))
    assert _spread(points + np.array([3.0, -1.0, 2.0])) == pytest.approx(_spread(points), rel=1e-12)
    assert _spread(2 * points) == pytest.approx(2 * _spread(points))
    assert _spread(np.array([[1.0, 2.0, 2.0], [-1.0, -2.0, -2.0]])) == pytest.approx(3.0)


def test_a_size_is_told_whole_and_taken():
    """Words to four digits, advice with the field to five; poses of this target alone go further away."""
    made = simulate(Scenario(samples=2, target="pose"), 0)
    (first, second) = made.recording.samples
    other = replace(second.observations[0], target="other")
    recording = replace(made.recording, samples=(first, replace(second, observations=(other,))))
    reading = target_size("board", 1.23456, made.cell)
    assert reading.words == "board is 1.235 times as large as stated"
    assert (reading.code, reading.about, reading.nested) == ("board-size", ("board",), True)
    cell, read = reading.apply(made.cell, recording)
    before, after = (r.samples[0].observations[0].camera_from_target for r in (recording, read))
    np.testing.assert_allclose(after.translation, 1.23456 * before.translation)
    np.testing.assert_array_equal(after.rotation, before.rotation)
    np.testing.assert_array_equal(
        read.samples[1].observations[0].camera_from_target.matrix, other.camera_from_target.matrix
    )
    assert cell.targets["board"].target is None
    assert reading.fix == "measure board and state its true size"
    seen = simulate(Scenario(samples=1), 0)
    size_m = seen.cell.targets["board"].target.options["square_m"]
    assert as_written(seen.cell, "board", 1.23456) == f": square_m would be {1.23456 * size_m:.5g}"


class Valley:
    """Costs and slopes by the factor's logarithm, in place of a cell's; what was asked for is kept."""

    def __init__(self, cost, slope=None, error=None):
        self.cost, self.slope_at, self.error, self.asked = cost, slope, error, []

    def optimum(self, log, state, steps, left=1.0):
        if self.error is not None:
            raise self.error
        self.asked.append(float(log))
        return SimpleNamespace(cost=self.cost(log), state=log)

    def slope(self, log, state):
        assert state == log
        return self.slope_at(log)


@pytest.mark.parametrize(("a", "b", "c"), [(2.0, 0.3, 1.0), (0.5, -0.02, 4.0)])
def test_a_parabola_has_its_vertex_and_its_gain(a, b, c):
    """Of a + b x + c x^2 the least is at -b / 2c, and less by the share b^2 / 4ac."""
    gain, vertex = _parabola(Valley(lambda x: a + b * x + c * x**2), None)
    assert gain == pytest.approx(b**2 / (4 * a * c), rel=1e-6)
    assert vertex == pytest.approx(-b / (2 * c), rel=1e-6)


@pytest.mark.parametrize(
    "valley",
    [
        Valley(lambda x: 1 - x**2),
        Valley(lambda x: 1.0),
        Valley(None, error=BasecalError("no")),
        Valley(None, error=np.linalg.LinAlgError()),
    ],
)
def test_what_is_no_parabola_may_gain_everything(valley):
    """Squares that fall to both sides, or do not change, and descents that fail, say nothing against another size."""
    assert _parabola(valley, None) == (1.0, np.inf)


@pytest.mark.parametrize("least", [-0.21, 0.03])
def test_the_factor_of_least_cost_is_found_from_the_best_of_those_tried(least):
    """By secants to its ten thousandth; a slope that bends is followed, too."""
    valley = Valley(lambda x: (x - least) ** 2, lambda x: 0.2 * ((x - least) + (x - least) ** 2))
    assert _refined(valley, [0.4, least + 0.05, -0.6], 9.0, None) == pytest.approx(np.exp(least), rel=1e-4)
    assert valley.asked[3] == pytest.approx(least + 0.05)


def test_steps_of_the_factor_are_bounded():
    """None is of more than a tenth, up or down; the first tells the slope's change alone."""
    for least in (2.0, -2.0):
        valley = Valley(lambda x: 1.0, lambda x, least=least: x - least)
        _refined(valley, [0.0], 9.0, None)
        steps = np.abs(np.diff(valley.asked[1:]))
        assert steps[0] < 0.01
        np.testing.assert_allclose(steps[1:], 0.1)


def test_where_no_step_leads_down_the_best_tried_is_kept():
    """A slope that falls, or that is the same everywhere; where numbers end it is the linear one."""
    for slope in (lambda x: -x, lambda x: 1.0):
        found = _refined(Valley(lambda x: x**2, slope), [0.1, -0.05], 9.0, None)
        assert found == pytest.approx(np.exp(-0.05), rel=5e-3)
    for error in (BasecalError("no"), np.linalg.LinAlgError()):
        assert _refined(Valley(None, error=error), [0.1], 1.7, None) == 1.7


def sized_case(made=None):
    """Poses of a target, and the true state."""
    made = made or simulate(Scenario(samples=4, target="pose"), 0)
    problem, _ = build_problem(made.cell, made.recording)
    return _Sized(made.cell, made.recording, "board"), State(made.truth, {}, np.zeros((len(problem.stops), 6)))


def test_the_slope_is_the_derivative_of_the_cost():
    """By differences of ten times the step, about a size that is not the stated one."""
    sized, state = sized_case()
    ends = [float(linearise(sized.problem(0.02 + d), state).cost) for d in (-1e-3, 1e-3)]
    assert sized.slope(0.02, state) == pytest.approx((ends[1] - ends[0]) / 2e-3, rel=1e-3)


def test_the_optimum_of_a_size_starts_without_errors_of_stops():
    """Downhill in as many steps as are asked for; poses that are so much nearer cost more."""
    made = simulate(Scenario(samples=5, target="pose", robot_noise=(1e-3, 1e-3)), 0)
    sized, state = sized_case(made)
    off = replace(state, stop_errors=np.full_like(state.stop_errors, 30.0))
    true, other = (sized.optimum(log, off, 8) for log in (0.0, 0.1))
    assert true.cost < 3 * 6 * 5
    assert other.cost > 2 * true.cost
    start = linearise(sized.problem(0.1), replace(state, stop_errors=np.zeros_like(state.stop_errors))).cost
    assert sized.optimum(0.1, off, 0).cost == pytest.approx(float(start))


def points_of_views(scales, seen):
    """A problem whose views show the target's points so much larger, as far as they are seen."""
    problem = simulated_problem(
        Scenario(samples=len(scales), target="points3d", point_m=0.0, state_observation_noise=False)
    )
    (group,) = problem.groups
    points = np.asarray(scales)[:, None, None] * group.measurement.points_in_target + np.array([0.1, 0.2, 0.7])
    shown = np.arange(points.shape[1]) < np.asarray(seen)[:, None]
    measurement = replace(group.measurement, points_in_camera=points, seen=shown)
    return problem, replace(group, measurement=measurement)


def test_points_in_space_show_the_size_by_their_spread():
    """The median of views with two points or more, of the group with most views; none where each shows one."""
    problem, group = points_of_views([1.1, 1.3, 1.2, 9.0], [4, 2, 2, 1])
    _, other = points_of_views([7.0, 7.0], [4, 4])
    problem = problem.with_groups([other, group, replace(group.take(np.arange(3)), target="another")])
    assert _factor(problem, "board", {}) == pytest.approx(1.2)
    problem, group = points_of_views([1.1, 1.3], [1, 1])
    assert _factor(problem.with_groups([group]), "board", {}) is None


@pytest.mark.parametrize("fixed", [(), ("x",), ("y",), ("z",), ("eye",), ("x", "y"), ("y", "z")])
def test_loops_give_the_factor_by_their_translations(fixed):
    """Distances seen too short by a third are stretched to close all loops; only what is fixed is taken as known."""
    a, c, (x, y, z) = (SE3.exp(np.random.default_rng(k).normal(size=(n, 6))) for k, n in ((0, 9), (1, 9), (2, 3)))
    b = (a @ x).inverse() @ y @ c @ z
    candidates = SE3(np.stack([b.rotation] * 2, 1), np.stack([b.translation / 1.5, b.translation * 3.0], 1))
    group = views(end("r", a, mount="x", base="eye" if "eye" in fixed else None), end("h", c, mount="z", base="y"))
    unknowns = {
        name: Unknown("fixed", SE3.identity()) if name in fixed else Unknown() for name in ("x", "y", "z", "eye")
    }
    known = [SE3(of.rotation, of.translation if name in fixed else 7 * of.translation + 1.0)
             for name, of in zip("xyz", (x, y, z), strict=True)]  # fmt: skip
    fit = LoopFit(tuple(known), np.zeros(9))
    found = _by_translations(SimpleNamespace(group=group), candidates, fit, SimpleNamespace(unknowns=unknowns))
    assert found == pytest.approx(1.5, rel=1e-9)


@pytest.mark.parametrize(
    ("gain", "vertex", "linear", "count"),
    [(0.2, 0.01, 1.1, None), (0.3, 0.04, 1.1, 1), (0.3, -0.06, 1.1, 7), (0.3, 0.06, 0.3, 7), (0.3, 0.06, -0.4, 6),
     (0.3, np.inf, 0.0, 6), (0.3, 0.01, None, None)],
)  # fmt: skip
def test_which_sizes_are_tried(monkeypatch, gain, vertex, linear, count):
    """Near the stated one the parabola's alone; else that of linear equations, and some up to a quarter off."""
    tried = []
    monkeypatch.setattr(target_sizes, "_parabola", lambda sized, state: (gain, vertex))
    monkeypatch.setattr(target_sizes, "_factor", lambda problem, name, lenses: linear)
    monkeypatch.setattr(target_sizes, "_refined", lambda sized, logs, linear, state: tried.extend(logs) or 1.25)
    sized, state = sized_case()
    found = size_hypotheses(sized.cell, sized.recording, {}, state)
    assert [h.words for h in found] == ([] if count is None else ["board is 1.25 times as large as stated"])
    assert len(tried) == (count or 0)
    if count == 1:
        assert tried == [vertex]
    elif count is not None:
        others = np.exp(tried[count - 6 :])
        assert tried[0] == pytest.approx(np.log(linear)) if count == 7 else True
        assert np.all((others > 0.75) & (others < 1.3))
        assert np.count_nonzero(others < 1) == 3
