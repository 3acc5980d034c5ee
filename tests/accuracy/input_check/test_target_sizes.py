"""Tests of the search for the size of a target."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.shared.declared import declared
from tests.shared.rewriting import resized, scaled, with_targets

from basecal.accuracy.input_check import target_sizes
from basecal.accuracy.input_check.target_sizes import (
    _best_factor,
    _spread,
    _spread_factor,
    _Step,
    _step,
    size_hypotheses,
    size_hypothesis,
)
from basecal.accuracy.phrases.target_length import corrected_length_clause
from basecal.errors import BasecalError
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate


def sizes(cell, recording):
    return size_hypotheses(declared(cell, recording), solve(cell, recording).state)


@pytest.mark.parametrize("target", ["charuco", "points3d", "pose"])
@pytest.mark.parametrize("factor", [0.5, 0.9, 1.2, 2.0])
def test_size_factor_is_found(target, factor):
    """A target stated too large by a factor is found smaller by it within 1 %; likewise observed poses too far away."""
    made = simulate(Scenario(samples=15, target=target, pose_noise=(2e-4, 5e-4)), 0)
    cell, recording = made.cell, made.recording
    if target == "pose":
        recording = with_targets(recording, scaled(factor))
    else:
        cell = resized(cell, {"board": factor})
    (reading,) = sizes(cell, recording)
    found = float(reading.words.split("is ")[1].split(" times")[0])
    assert found * factor == pytest.approx(1.0, abs=0.01)


def test_led_has_no_size():
    """An LED is a single point and has no size."""
    made = simulate(Scenario(samples=15, target="led", camera_mount="fixed"), 0)
    assert sizes(made.cell, made.recording) == []


@pytest.mark.parametrize("target", ["charuco", "points3d"])
def test_correct_size_is_not_changed(target):
    """No other size is found for a correct one, nor for one off by a thousandth with robot noise."""
    made = simulate(Scenario(samples=12, target=target), 0)
    assert sizes(made.cell, made.recording) == []
    noisy = simulate(Scenario(samples=12, target=target, robot_noise=(1e-3, 2e-3)), 0)
    assert sizes(resized(noisy.cell, {"board": 1.001}), noisy.recording) == []


def test_spread_is_about_mean_of_points():
    """The spread is about the mean of the points, wherever their origin is."""
    points = np.random.default_rng(0).normal(size=(6, 3))
    assert _spread(points + np.array([3.0, -1.0, 2.0])) == pytest.approx(_spread(points), rel=1e-12)
    assert _spread(2 * points) == pytest.approx(2 * _spread(points))
    assert _spread(np.array([[1.0, 2.0, 2.0], [-1.0, -2.0, -2.0]])) == pytest.approx(3.0)


def test_wording_of_size_hypothesis():
    """A size hypothesis states the factor to four digits and the corrected field to five."""
    made = simulate(Scenario(samples=2, target="pose"), 0)
    reading = size_hypothesis("board", 1.23456, made.cell)
    assert reading.words == "board is 1.235 times as large as stated"
    assert (reading.code, reading.about, reading.is_wider) == ("board-size", ("board",), True)
    assert reading.fix == "measure board and state its true size"
    seen = simulate(Scenario(samples=1), 0)
    size_m = seen.cell.targets["board"].target.options["square_m"]
    assert corrected_length_clause(seen.cell, "board", 1.23456) == f": square_m would be {1.23456 * size_m:.5g}"


def steps(monkeypatch, gain, sizes_left, spread=None, costs=(1.0,)):
    """The best factor with steps of these lengths, and the logarithms at which the steps were taken."""
    taken = []

    def step(reading, name, log, state):
        """The next of the steps."""
        k = len(taken)
        taken.append(log)
        return _Step(costs[min(k, len(costs) - 1)], gain, sizes_left[min(k, len(sizes_left) - 1)], state)

    monkeypatch.setattr(target_sizes, "_step", step)
    monkeypatch.setattr(target_sizes, "_spread_factor", lambda reading, name: spread)
    return _best_factor(None, "board", None), taken


@pytest.mark.parametrize(("gain", "is_found"), [(0.24, False), (0.26, True)])
def test_size_search_needs_quarter_of_squares(monkeypatch, gain, is_found):
    """The size search needs a gain of a quarter of the squares in its first step.

    The spread of points in space must gain as much.
    """
    found, taken = steps(monkeypatch, gain, [0.2, 0.0])
    assert (found is not None) == is_found
    assert len(taken) == (2 if is_found else 1)
    found, taken = steps(monkeypatch, 0.0, [0.0], spread=1.5, costs=(1.0, 1 - gain))
    assert found == (1.5 if is_found else None)
    np.testing.assert_allclose(taken, [0.0, np.log(1.5)])


def test_size_steps_end_at_convergence(monkeypatch):
    """Steps continue from the last size until it converges, at most ten after the first."""
    found, taken = steps(monkeypatch, 1.0, [0.2, 0.1, -1e-6])
    assert found == pytest.approx(np.exp(0.3))
    np.testing.assert_allclose(taken, [0.0, 0.2, 0.3])
    assert len(steps(monkeypatch, 1.0, [0.1])[1]) == 11


@pytest.mark.parametrize("error", [BasecalError("no"), np.linalg.LinAlgError()])
def test_failed_size_step_gives_no_hypothesis(monkeypatch, error):
    """A target whose size step fails gets no size hypothesis."""

    def fails(*given):
        raise error

    monkeypatch.setattr(target_sizes, "_step", fails)
    cell = SimpleNamespace(targets={"board": SimpleNamespace(has_free_scale=False)})
    problem = SimpleNamespace(groups=[SimpleNamespace(target="board")])
    assert size_hypotheses(SimpleNamespace(cell=cell, problem=problem), None) == []


def test_led_has_no_size_step():
    """An LED has no size to gain: its step is zero at the optimum."""
    made = simulate(Scenario(samples=8, target="led", camera_mount="fixed", pixel_px=0.0, state_pixel_noise=False), 0)
    reading = declared(made.cell, made.recording)
    found = _step(reading, "board", 0.0, solve(made.cell, made.recording).state)
    assert (found.gain, found.log_ratio) == (0.0, 0.0)
    assert found.cost == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("count", "known"), [(0, False), (1, False), (2, True), (3, True)])
def test_spread_factor_needs_two_points(count, known):
    """The spread factor is the median over views with at least two points of the named target."""
    made = simulate(Scenario(samples=3, target="points3d"), 0)
    reading = declared(made.cell, made.recording)
    (group,) = reading.problem.groups
    measurement = group.measurement
    factors = np.array([1.0, 3.0, 4.0])[:, None, None]
    seen = np.zeros_like(measurement.seen)
    seen[:, :count] = True
    points = factors * np.broadcast_to(measurement.points_in_target, (3, *seen.shape[1:], 3))
    larger = replace(group, measurement=replace(measurement, points_in_camera=points, seen=seen))
    changed = replace(reading, problem=reading.problem.with_groups([larger]))
    found = _spread_factor(changed, "board")
    assert found == (pytest.approx(3.0) if known else None)
    assert _spread_factor(changed, "other") is None
