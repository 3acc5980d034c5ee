"""Tests of the splits into folds: stations stay together, and every sample is held out once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.ends import end, problem_of, views, with_hand

from basecal.accuracy.cross_validation.folds import _join_parts, _places, _split, instant_split, splits
from basecal.cell import Recording
from basecal.estimation.problem.build import build_problem
from basecal.simulation import Scenario, simulate


def pack_scenario(scenario: Scenario, seed: int = 0):
    made = simulate(scenario, seed)
    return build_problem(made.cell, made.recording)[0]


@pytest.mark.parametrize("arms", ["both", "stations", "halves", "eye_still"])
def test_every_sample_is_held_out_once(arms):
    """Each split holds out every sample exactly once, in five folds of six of the thirty samples."""
    ways = list(splits(pack_scenario(Scenario(arms=arms))))
    assert ways
    for way in ways:
        assert sorted(number for fold in way.folds for number in fold) == list(range(30))
        assert sorted(number for part in way.parts for number in part) == list(range(30))
    assert sorted(map(len, ways[0].folds)) == [6] * 5


def test_stations_stay_together():
    """If the eye stands at five places, each place is a fold, though hand poses are all different."""
    problem = pack_scenario(Scenario(arms="stations", stations=5))
    eye = problem.groups[0].eye.base_from_flange.translation
    for fold in next(splits(problem)).folds:
        assert np.ptp(eye[sorted(fold)], axis=0).max() == 0.0


def test_repeated_poses_stay_together():
    """If the hand visits six places at each of five of the eye, places of one arm are held out, the fewest first."""
    made = simulate(Scenario(samples=30), 0)
    samples = made.recording.samples
    crossed = tuple(
        type(s)(
            s.sample,
            s.stamp_s,
            {"eye": samples[k // 6].robots["eye"], "hand": samples[k % 6].robots["hand"]},
            s.observations,
        )
        for k, s in enumerate(samples)
    )
    ways = list(splits(build_problem(made.cell, Recording(crossed))[0]))
    assert {frozenset(range(6 * k, 6 * k + 6)) for k in range(5)} == set(ways[0].parts)


def test_still_half_is_not_held_out_whole():
    """A robot at rest for half of the samples does not make them one part."""
    assert max(map(len, next(splits(pack_scenario(Scenario(arms="halves")))).folds)) <= 6


def test_samples_without_robot_share_no_stop():
    """Numbers of samples without a robot are not used as its stops: other numbers give the same splits."""
    made = simulate(Scenario(samples=8, layout="chain", robots=3), 0)
    parts = []
    for first in (0, 1000):
        samples = (replace(s, sample=first + s.sample) for s in made.recording.samples)
        problem = build_problem(made.cell, Recording(tuple(samples)))[0]
        parts.append([[sorted(n - first for n in part) for part in way.parts] for way in splits(problem)])
    assert parts[0] == parts[1]


def test_few_samples_are_held_out_singly():
    """Four samples make four folds; two make none."""
    assert next(splits(pack_scenario(Scenario(samples=4)))).folds == tuple(frozenset({k}) for k in range(4))
    assert list(splits(pack_scenario(Scenario(samples=2)))) == []


def test_instant_split_separates_stations():
    """The mildest split deals the samples of a still eye's stations singly, except those that repeat another."""
    made = simulate(Scenario(samples=12, arms="stations", stations=3), 0)
    samples = list(made.recording.samples)
    samples[7] = replace(samples[7], robots=samples[2].robots)
    problem = build_problem(made.cell, Recording(tuple(samples)))[0]
    mild = instant_split(problem, 3)
    assert mild is not None
    assert frozenset({2, 7}) in mild.parts
    assert len(mild.parts) == 11
    assert sorted(map(len, mild.folds)) == [4, 4, 4]


def parts(*sizes):
    """Parts of the given sizes, numbered consecutively."""
    ends = np.cumsum(sizes)
    return [frozenset(range(end - size, end)) for size, end in zip(sizes, ends, strict=True)]


@pytest.mark.parametrize(("sizes", "is_split"), [
    ((1, 1, 1), True), ((1, 1), False), ((), False),  # three parts of one sample each are enough
    ((2, 2, 1), True), ((2, 1, 1), False),  # two fifths of the samples are allowed, a half is not
    ((4, 3, 3), True), ((5, 3, 3), False),
])  # fmt: skip
def test_split_needs_three_parts_of_limited_size(sizes, is_split):
    """A split needs three parts, none with more than two fifths of the samples."""
    found = _split(parts(*sizes), sum(sizes), 5)
    assert (found is not None) == is_split
    assert found is None or found.parts == tuple(parts(*sizes))


def test_parts_are_dealt_to_smallest_fold():
    """Parts are dealt to the first fold with the fewest samples.

    There are at most as many folds as requested, or as parts.
    """
    made = parts(3, 1, 2, 2, 1, 1)
    found = _split(made, 10, 3)
    assert found.folds == (made[0] | made[5], made[1] | made[3], made[2] | made[4])
    assert len(_split(made, 10, 8).folds) == 6


def test_parts_share_no_place():
    """Samples that share a place of either robot are in one part, also those joined by a third."""
    places = {"eye": {0: "a", 1: "b", 2: "a", 3: "c", 5: "e"}, "hand": {1: "x", 3: "y", 4: "x", 2: "z", 5: "y"}}
    assert set(_join_parts(range(7), places)) == {frozenset(each) for each in ((0, 2), (1, 4), (3, 5), (6,))}
    places["hand"][2] = "x"
    assert set(_join_parts(range(7), places)) == {frozenset(each) for each in ((0, 1, 2, 4), (3, 5), (6,))}


def test_splits_go_from_all_robots_to_instants():
    """Splits use places of any robot, then of the robot with the fewest places, the others, and single instants."""
    eye, hand = [0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3], [0, 1, 2, 3, 4, 5, 0, 1, 2, 3, 4, 4]
    group = views(end("eye", stop_number=eye), end("hand", stop_number=hand))
    still = views(end("still", stop_number=np.zeros(12)), end(stop_number=np.full(12, -1)))
    found = list(splits(problem_of(group, still)))
    by_eye = [frozenset(range(3 * k, 3 * k + 3)) for k in range(4)]
    by_hand = [frozenset(np.flatnonzero(np.equal(hand, k)).tolist()) for k in range(6)]
    instants = [*(frozenset({k}) for k in range(10)), frozenset({10, 11})]
    assert [list(each.parts) for each in found] == [by_eye, by_hand, instants]


def test_places_are_stops_of_moving_robots():
    """Places are the stops of robots with two or more, in views of one group or several."""
    one = replace(views(end("eye", stop_number=[0, 1]), end("hand", stop_number=[7, 7])), sample=np.array([4, 5]))
    two = replace(views(end("eye", stop_number=[0]), end("other", stop_number=[3])), sample=np.array([6]))
    world = replace(views(end(stop_number=[-1]), end("hand", stop_number=[7])), sample=np.array([7]))
    assert _places(problem_of(one, two, world)) == {"eye": {4: 0, 5: 1, 6: 0}}
    world = with_hand(world, stop_number=np.array([8]))
    assert _places(problem_of(one, two, world))["hand"] == {4: 7, 5: 7, 7: 8}
