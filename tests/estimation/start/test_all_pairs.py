"""Tests of starting many bases by all pairs at once."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from tests.ends import end, views, with_eye

from basecal.estimation.problem.build import build_problem
from basecal.estimation.start import all_pairs
from basecal.estimation.start.all_pairs import place_by_pairs
from basecal.estimation.start.first_state import first_state
from basecal.estimation.start.pair_views import PairViews, pair_views
from basecal.estimation.start.refinement import Refinement, refine_jointly
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

RING = Scenario(layout="ring", robots=9, samples=18 * 12)


@pytest.fixture(scope="module")
def made():
    return simulate(RING, 2)


def farthest(made, transforms):
    """Largest error of the named transforms [m, rad]."""
    return max(np.abs((pose.inverse() @ made.truth[name]).log()).max() for name, pose in transforms.items())


def all_pair_views(made, problem):
    return [pair_views(group, made.cameras[group.camera], 20, 16) for group in problem.groups]


def test_long_rings_start_near_the_truth(made) -> None:
    """Every base and mount is within 20 mm and 20 mrad, without a guess."""
    problem, _ = build_problem(made.cell, made.recording)
    assert farthest(made, first_state(problem, made.cell, False).transforms) < 0.02


@pytest.mark.journey
@pytest.mark.parametrize(("robots", "samples"), [(100, 3000), (30, 360)])
def test_bases_of_many_robots_do_not_drift(robots, samples) -> None:
    """Bases start within 0.2 m.

    A hundred are off by 0.31 m by the shortest chains. Of thirty with six samples of each pair, some pairs must be
    searched again. Otherwise bases are off by 11 m. No descent converges from either.
    """
    made = simulate(Scenario(layout="ring", robots=robots, samples=samples, robot_noise=(1e-4, 1e-4)), 1)
    problem, _ = build_problem(made.cell, made.recording)
    found = first_state(problem, made.cell, False).transforms
    assert max(np.linalg.norm((found[k].inverse() @ made.truth[k]).translation) for k in found if "base" in k) < 0.2


def test_wrong_start_of_pairs_does_not_affect_others(made) -> None:
    """One wrong base and one wrong camera leave the others correct."""
    problem, _ = build_problem(made.cell, made.recording)
    wrong = dict(made.truth)
    for name in ("r1_base_from_r4_base", "r6_flange_from_camera6"):
        wrong[name] = wrong[name] @ SE3.exp([0.5, -2.0, 1.0, 1.5, -1.0, 0.5])
    found = place_by_pairs(problem, all_pair_views(made, problem), wrong, ())
    assert set(found) == set(made.truth)
    assert farthest(made, found) < 0.02


def test_drifted_pairs_need_no_search(made, monkeypatch, rng) -> None:
    """Mounts are off by 0.3 rad for each axis, as at the end of a long chain. All are corrected without a search."""
    wished = []

    def watched(wishes, *steps):
        wished.extend(wishes)
        return refine_jointly(wishes, *steps)

    monkeypatch.setattr(all_pairs, "refine_jointly", watched)
    problem, _ = build_problem(made.cell, made.recording)
    drifted = {name: pose @ SE3.exp(rng.normal(0, 0.3, 6)) for name, pose in made.truth.items()}
    assert farthest(made, place_by_pairs(problem, all_pair_views(made, problem), drifted, ())) < 0.02
    assert len(wished) == len(problem.groups)
    assert not any(wish.searched for wish in wished)


def test_few_or_known_bases_are_not_placed(made) -> None:
    """Few bases, or bases beside a known one, keep their earlier placement."""
    problem, _ = build_problem(made.cell, made.recording)
    assert place_by_pairs(problem, all_pair_views(made, problem), made.truth, ("r1_base_from_r4_base",)) == {}
    few = simulate(Scenario(layout="ring", robots=4, samples=80), 1)
    problem, _ = build_problem(few.cell, few.recording)
    assert place_by_pairs(problem, all_pair_views(few, problem), few.truth, ()) == {}


def test_bases_without_a_good_pair_are_not_placed(made, rng) -> None:
    """If a robot's poses are unrelated to its views, the earlier placement of all bases is kept."""
    problem, _ = build_problem(made.cell, made.recording)

    def spoilt(sight):
        """The pair with random poses of its camera's robot."""
        poses = SE3.exp(rng.uniform(-1, 1, (len(sight.group), 6)))
        return replace(sight, group=with_eye(sight.group, base_from_flange=poses))

    seen = [spoilt(s) if "r5" in (s.group.eye.robot, s.group.hand.robot) else s for s in all_pair_views(made, problem)]
    assert place_by_pairs(problem, seen, made.truth, ()) == {}


NAMES = [None, *(f"b{k}" for k in range(8))]


def make_pair(rng, bases, k, eye, hand, turned_rad=(0.0,) * 5):
    """Views of the k-th camera and target between two bases, rotated off the truth, and X, Y and Z."""
    n, at = len(turned_rad), {None: SE3.identity(), **bases}
    a, c = SE3.exp(rng.standard_normal((n, 6))), SE3.exp(rng.standard_normal((n, 6)))
    x, z = SE3.exp(rng.standard_normal(6)), SE3.exp(rng.standard_normal(6))
    y = at[eye].inverse() @ at[hand]
    b = (a @ x).inverse() @ y @ c @ z @ SE3.from_rotvec(np.outer(turned_rad, [0.6, 0.0, 0.8]), np.zeros((n, 3)))
    weight = np.ones((n, 6))
    ends = end(eye, a, mount=f"x{k}", base=eye), end(hand, c, mount=f"z{k}", base=hand)
    group = views(*ends, PoseMeasurement(b, weight, weight), camera=f"c{k}", target=f"t{k}")
    both = SE3(np.stack([b.rotation] * 2, 1), np.stack([b.translation] * 2, 1))
    return PairViews(group, both, np.ones(n), n), (x, y, z)


@pytest.fixture
def ring(rng):
    """Eight bases about the reference and nine pairs of neighbours, with views off by a milliradian."""
    bases = {name: SE3.exp(rng.uniform(-1, 1, 6)) for name in NAMES if name}
    pairs = [make_pair(rng, bases, k, NAMES[k], NAMES[(k + 1) % 9], (1e-3,) * 5) for k in range(9)]
    return bases, pairs


def place_bases_of_pairs(monkeypatch, pairs, given=()):
    """The bases and mounts placed by pairs with these X, Y and Z."""

    def refined_pairs(views):
        triples = [dict(found)[id(sight)] for sight in views]
        return triples, np.array([all_pairs._misfit(*each) for each in zip(views, triples, strict=True)])

    monkeypatch.setattr(all_pairs, "_make_refinement", lambda _, sight, *__: sight)
    monkeypatch.setattr(all_pairs, "_refine_pairs", refined_pairs)
    found = [(id(sight), triple) for sight, triple in pairs]
    return place_by_pairs(None, [sight for sight, _ in pairs], {}, given)


def test_bases_fit_all_pairs_and_mounts_the_best_pair(ring, rng, monkeypatch) -> None:
    """Known transforms are unchanged.

    A pair that fits badly, one without poses, and one of a robot with itself place no base.
    """
    bases, pairs = ring
    off = SE3.exp(np.full(6, 0.5))
    sight, (x, y, z) = make_pair(rng, bases, 9, "b2", "b5")
    pairs.append((sight, (x, y @ off, z)))
    best, worse = (make_pair(rng, bases, 3, "b2", "b6", (turned_rad,) * 5) for turned_rad in (0.5e-3, 2e-3))
    pairs = [best, *pairs, worse]
    without, _ = make_pair(rng, bases, 10, "b1", "b3")
    pairs.append((replace(without, candidates=None), (off, off, off)))
    alone, triple = make_pair(rng, bases, 11, "b4", "b4")
    pairs.append((alone, (off, triple[1] @ off, off)))
    found = place_bases_of_pairs(monkeypatch, pairs, ("x5",))
    assert set(found) == {*bases, *(f"{of}{k}" for of in "xz" for k in range(10))} - {"x5"}
    assert max(np.abs((found[name].inverse() @ pose).log()).max() for name, pose in bases.items()) < 1e-6
    np.testing.assert_array_equal(found["x3"].matrix, best[1][0].matrix)


@pytest.mark.parametrize(("bases", "given", "are_placed"), [(8, (), True), (7, (), False), (8, ("b3",), False)])
def test_eight_free_bases_are_needed(rng, monkeypatch, bases, given, are_placed) -> None:
    """The reference does not count. With seven, or if one is known, nothing is placed."""
    names = NAMES[: bases + 1]
    at = {name: SE3.exp(rng.uniform(-1, 1, 6)) for name in names if name}
    pairs = [make_pair(rng, at, k, first, second) for k, (first, second) in enumerate(pairwise(names))]
    assert bool(place_bases_of_pairs(monkeypatch, pairs, given)) == are_placed


@pytest.mark.parametrize(("ratio", "is_searched"), [(3.9, False), (4.1, True)])
@pytest.mark.parametrize("is_better", [True, False])
def test_pairs_that_fit_badly_are_searched(ring, rng, monkeypatch, ratio, is_searched, is_better) -> None:
    """A pair with more than four times the median misfit is searched, and the better result is kept."""
    bases, pairs = ring
    pairs[4] = bad, (x, y, z) = make_pair(rng, bases, 4, "b3", "b4", (ratio * 1e-3,) * 5)
    triples = [triple for _, triple in pairs]
    rotation = SE3.from_rotvec([0.48e-3, 0.0, 0.64e-3] if is_better else [0.1, 0.0, 0.0], np.zeros(3))
    searched, rounds = (x, y, z @ rotation), []

    def refined(requests, *_):
        rounds.append([request.searched for request in requests])
        return list(triples) if len(rounds) == 1 else [searched] * len(requests)

    monkeypatch.setattr(all_pairs, "refine_jointly", refined)
    monkeypatch.setattr(all_pairs, "_restart_pairs", lambda requests: requests)
    requests = [Refinement(sight, sight.loop(None, None, None, 0), [triple], False) for sight, triple in pairs]
    found, misfit = all_pairs._refine_pairs(requests)
    assert rounds == [[False] * 9, [True] * is_searched]
    assert [new is old for new, old in zip(found, triples, strict=True)] == [
        k != 4 or not (is_searched and is_better) for k in range(9)
    ]
    assert misfit[4] == pytest.approx(all_pairs._misfit(bad, found[4]))


def test_pairs_without_a_fit_are_wrong() -> None:
    """Pairs without a finite misfit place no base, even if they are most of the pairs."""
    assert all_pairs._is_wrong(np.array([np.inf, np.inf, np.inf, 1e-3])).tolist() == [True, True, True, False]


def test_misfit_of_a_pair_is_a_median_angle(rng) -> None:
    """The misfit is the median angle of a pair's views.

    The better pose of each view counts, and a few outliers have no effect.
    """
    sight, triple = make_pair(rng, {"b0": SE3.identity()}, 0, None, "b0", (0.1, 0.2, 3.0, -0.15, 0.01))
    assert all_pairs._misfit(sight, triple) == pytest.approx(0.15)
    nowhere = SE3(np.full((3, 3), np.nan), np.zeros(3))
    assert all_pairs._misfit(sight, (triple[0], nowhere, triple[2])) == np.inf
