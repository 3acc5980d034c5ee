"""Views that can be read in several ways end up read as all of them together say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import CandidateObservation, Recording
from basecal.cell.targets.charuco import charuco_target
from basecal.cell.targets.chessboard import chessboard_target
from basecal.cell.targets.circles import circles_target
from basecal.estimation.problem.correspondence import half_turn
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate


def off(first, second) -> float:
    return float(np.abs((first.inverse() @ second).log()).max())


def turned_round(sample):
    (seen,) = sample.observations
    return replace(sample, observations=(replace(seen, ids=(seen.ids.max() + seen.ids.min() - seen.ids)),))


@pytest.mark.parametrize("seed", range(4))
def test_chessboards_read_from_either_end_are_sorted_out(seed):
    """With each view's corners numbered from a random end, the bases are those of the consistently numbered views."""
    s = simulate(Scenario(target="chessboard", spread_rad=0.4), seed)
    flips = np.random.default_rng(seed).random(len(s.recording.samples)) < 0.5
    mixed = tuple(turned_round(x) if f else x for x, f in zip(s.recording.samples, flips, strict=True))
    clean, sorted_out = solve(s.cell, s.recording), solve(s.cell, Recording(mixed))
    assert sorted_out.cost == pytest.approx(clean.cost, rel=1e-6)
    for name in ("eye_base_from_hand_base", "eye_flange_from_wrist"):
        assert off(clean.state.transforms[name], sorted_out.state.transforms[name]) < 1e-7


@pytest.mark.parametrize("mounts", ["fixed", "free"])
def test_the_light_is_found_among_reflections(mounts):
    """Where a third of the views list a reflection first, the answer is still that of the light alone."""
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
    assert all(off(found.state.transforms[n], t) < 1e-7 for n, t in clean.state.transforms.items())


def test_half_turn_maps_the_grid_onto_itself_backwards():
    """Point k of a turned chessboard is point n - 1 - k; a ChArUco board has no half turn."""
    board = chessboard_target((5, 4), 0.03)
    target_from_turned = half_turn(board)
    np.testing.assert_allclose(target_from_turned @ board.points, board.points[::-1], atol=1e-15)
    assert half_turn(charuco_target((5, 4), 0.03, 0.02, "DICT_4X4_50")) is None
    assert half_turn(circles_target((4, 11), 0.02, asymmetric=True)) is None
