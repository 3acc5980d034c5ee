"""Tests of choosing among several readings of views by their joint prediction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import CandidateObservation, Recording
from basecal.cell.targets.charuco import charuco_target
from basecal.cell.targets.chessboard import chessboard_target
from basecal.cell.targets.circles import circles_target
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.correspondence import choose_correspondence, half_turn, half_turn_views
from basecal.estimation.problem.problem import State
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate


def distance(first, second) -> float:
    return float(np.abs((first.inverse() @ second).log()).max())


def reverse_ids(sample):
    (seen,) = sample.observations
    return replace(sample, observations=(replace(seen, ids=(seen.ids.max() + seen.ids.min() - seen.ids)),))


@pytest.mark.parametrize("seed", range(4))
def test_chessboards_read_from_either_end_are_resolved(seed):
    """With each view numbered from a random end, the bases equal those of consistently numbered views."""
    s = simulate(Scenario(target="chessboard", spread_rad=0.4), seed)
    flips = np.random.default_rng(seed).random(len(s.recording.samples)) < 0.5
    mixed = tuple(reverse_ids(x) if f else x for x, f in zip(s.recording.samples, flips, strict=True))
    clean, sorted_out = solve(s.cell, s.recording), solve(s.cell, Recording(mixed))
    assert sorted_out.cost == pytest.approx(clean.cost, rel=1e-6)
    for name in ("eye_base_from_hand_base", "eye_flange_from_wrist"):
        assert distance(clean.state.transforms[name], sorted_out.state.transforms[name]) < 1e-7


@pytest.mark.journey
@pytest.mark.parametrize("mounts", ["fixed", "free"])
def test_led_is_found_among_reflections(mounts):
    """If a third of the views list a reflection first, the result is still that of the LED alone."""
    scenario = Scenario(target="led", camera_mount=mounts, target_mount=mounts, samples=40)
    s = simulate(scenario, 1)
    rng = np.random.default_rng(1)
    listed = []
    for sample in s.recording.samples:
        (seen,) = sample.observations
        spots = np.concatenate([seen.pixels, rng.uniform([0, 0], [1280, 720], (2, 2))])
        first = rng.random() < 0.3 if mounts == "fixed" else False
        order = [1, 0, 2] if first else [0, 2, 1]
        candidates = CandidateObservation(seen.camera, seen.target, spots[order], None)
        listed.append(replace(sample, observations=(candidates,)))
    clean, found = solve(s.cell, s.recording), solve(s.cell, Recording(tuple(listed)))
    assert all(distance(found.state.transforms[n], t) < 1e-7 for n, t in clean.state.transforms.items())


def test_half_turn_reverses_the_grid():
    """Point k of a chessboard rotated by half a turn is point n - 1 - k, and a ChArUco board has no half turn."""
    board = chessboard_target((5, 4), 0.03)
    target_from_turned = half_turn(board)
    np.testing.assert_allclose(target_from_turned @ board.points, board.points[::-1], atol=1e-15)
    np.testing.assert_array_equal(target_from_turned.rotation, np.diag([-1, -1, 1]))
    assert half_turn(charuco_target((5, 4), 0.03, 0.02, "DICT_4X4_50")) is None
    assert half_turn(circles_target((4, 11), 0.02, asymmetric=True)) is None


@pytest.mark.parametrize("detected", [False, True])
def test_views_are_read_as_the_state_predicts(detected):
    """All values of a point are reversed with it: 1 / sigma, weight and detected shares.

    The other views are unchanged.
    """
    made = simulate(Scenario(samples=6, target="chessboard", spread_rad=0.3), 3)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    rng, n = np.random.default_rng(0), len(group.measurement.points_in_target)
    flips = np.array([True, False, True, True, False, False])
    seen = rng.random((6, n)) < 0.8
    weight = seen * rng.uniform(1, 5, (6, n))
    right = replace(
        group.measurement,
        seen=seen,
        weight=weight,
        stated=0.5 * weight,
        relative=rng.uniform(0.5, 2, (6, n)) if detected else None,
    )
    fields = ("pixels", "seen", "weight", "stated", *(["relative"] if detected else []))

    def turned(array):
        return np.where(flips.reshape(6, *[1] * (array.ndim - 1)), array[:, ::-1], array)

    wrong = replace(right, **{name: turned(getattr(right, name)) for name in fields})
    mixed = replace(group, measurement=wrong, readings=(wrong, half_turn_views(wrong)))
    state = State(made.truth, made.cameras, np.zeros((0, 6)))
    after, changed = choose_correspondence(problem.with_groups([mixed]), state)
    assert changed
    for name in fields:
        np.testing.assert_array_equal(getattr(after.groups[0].measurement, name), getattr(right, name))
    assert (after.groups[0].measurement.relative is None) != detected
    again, changed = choose_correspondence(after, state)
    assert (again is after, changed) == (True, False)
