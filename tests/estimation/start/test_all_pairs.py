"""Many bases started by all pairs at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.problem.build import build_problem
from basecal.estimation.start import all_pairs
from basecal.estimation.start.all_pairs import placed_by_pairs
from basecal.estimation.start.first_state import first_state
from basecal.estimation.start.pair_views import pair_views
from basecal.estimation.start.refinement import refined_together
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

RING = Scenario(layout="ring", robots=9, samples=18 * 12)


@pytest.fixture(scope="module")
def made():
    return simulate(RING, 2)


def farthest(made, transforms):
    """Largest error of the named transforms [m, rad]."""
    return max(np.abs((pose.inverse() @ made.truth[name]).log()).max() for name, pose in transforms.items())


def sights(made, problem):
    return [pair_views(group, made.cameras[group.camera], 20, 16) for group in problem.groups]


def test_long_rings_start_near(made) -> None:
    """Every base and mount within some millimetres and milliradians, from nothing."""
    problem, _ = build_problem(made.cell, made.recording)
    assert farthest(made, first_state(problem, made.cell, False).transforms) < 0.02


def test_pairs_that_start_wrong_are_searched(made) -> None:
    """A base and a camera placed anyhow do not spoil the others."""
    problem, _ = build_problem(made.cell, made.recording)
    wrong = dict(made.truth)
    for name in ("r1_base_from_r4_base", "r6_flange_from_camera6"):
        wrong[name] = wrong[name] @ SE3.exp([0.5, -2.0, 1.0, 1.5, -1.0, 0.5])
    found = placed_by_pairs(problem, sights(made, problem), wrong, ())
    assert set(found) == set(made.truth)
    assert farthest(made, found) < 0.02


def test_pairs_that_drifted_need_no_search(made, monkeypatch, rng) -> None:
    """Mounts off by 0.3 rad an axis, as at the end of a long chain: all are right without a search."""
    wished = []

    def watched(wishes):
        wished.extend(wishes)
        return refined_together(wishes)

    monkeypatch.setattr(all_pairs, "refined_together", watched)
    problem, _ = build_problem(made.cell, made.recording)
    drifted = {name: pose @ SE3.exp(rng.normal(0, 0.3, 6)) for name, pose in made.truth.items()}
    assert farthest(made, placed_by_pairs(problem, sights(made, problem), drifted, ())) < 0.02
    assert len(wished) == len(problem.groups)
    assert not any(wish.searched for wish in wished)


def test_few_bases_and_known_ones_are_left(made) -> None:
    """To whoever placed them."""
    problem, _ = build_problem(made.cell, made.recording)
    assert placed_by_pairs(problem, sights(made, problem), made.truth, ("r1_base_from_r4_base",)) == {}
    few = simulate(Scenario(layout="ring", robots=4, samples=80), 1)
    problem, _ = build_problem(few.cell, few.recording)
    assert placed_by_pairs(problem, sights(few, problem), few.truth, ()) == {}


def test_bases_that_no_right_pair_reaches_are_left(made, rng) -> None:
    """Where a robot's poses are of anything else, whoever placed all bases has the better word."""
    problem, _ = build_problem(made.cell, made.recording)

    def spoilt(sight):
        """The pair, its camera's robot anywhere."""
        poses = SE3.exp(rng.uniform(-1, 1, (len(sight.group), 6)))
        return replace(sight, group=replace(sight.group, eye_base_from_eye_flange=poses))

    seen = [spoilt(s) if "r5" in (s.group.eye, s.group.hand) else s for s in sights(made, problem)]
    assert placed_by_pairs(problem, seen, made.truth, ()) == {}
