"""The size that a target would have to have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.input_check.hypotheses import resized
from basecal.accuracy.input_check.rewriting import scaled, with_targets
from basecal.accuracy.input_check.target_sizes import (
    _parabola,
    _Sized,
    _spread,
    as_written,
    size_hypotheses,
    target_size,
)
from basecal.estimation.solve import solve
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
