"""Cells of many robots, pair by pair."""

from __future__ import annotations

import numpy as np
import pytest
from tests.ends import end, problem_of, views
from tests.shared.rewriting import inverted, with_robots

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.readings.reading import declared_reading
from basecal.accuracy.readings.single_pairs import _covering, has_many_robots, merge_findings, solve_single_pairs
from basecal.cell import Finding
from basecal.cell.targets.charuco import charuco_target
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve_problem
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

BOARD = charuco_target((4, 4), 0.04, 0.03, "DICT_4X4_50")
RING = simulate(Scenario(layout="ring", robots=6, samples=120, board=BOARD, robot_noise=(1e-4, 1e-4)), 1)


@pytest.fixture(scope="module")
def pairs():
    problem, _ = build_problem(RING.cell, RING.recording)
    state = State({n: RING.truth[n] for n in problem.unknowns}, RING.cameras, np.zeros((len(problem.stops), 6)))
    return solve_single_pairs(declared_reading(RING.cell, RING.recording, problem), state)


def test_two_arms_are_looked_at_together():
    """A pair of arms is one cell, a ring of six is many."""
    two = simulate(Scenario(samples=4), 1)
    assert not has_many_robots(build_problem(two.cell, two.recording)[0])
    assert has_many_robots(build_problem(RING.cell, RING.recording)[0])


def test_each_robot_camera_and_target_is_in_a_pair(pairs):
    """And no more pairs than it takes: half of those that a ring with loops has."""
    assert {name for pair in pairs for name in pair.robots} == RING.cell.robots.keys()
    assert {name for pair in pairs for name in pair.reading.cell.cameras} == RING.cell.cameras.keys()
    assert {name for pair in pairs for name in pair.reading.cell.targets} == RING.cell.targets.keys()
    assert len(pairs) == 6


def test_a_pair_tells_how_its_bases_stand(pairs):
    """Solved alone, with the eye's base where it is, the hand's base is the truth within six sigmas an axis."""
    for pair in pairs[:3]:
        found = solve_problem(pair.reading.problem, pair.reading.cell, Settings(robot_noise="stated"))
        name = pair.reading.cell.requested_transforms[0]
        estimate = found.transforms[name]
        off = (estimate.mean.inverse() @ RING.truth[name]).log() / np.sqrt(np.diag(estimate.covariance))
        assert np.abs(off).max() < 6


def test_what_one_pair_leaves_open_another_may_tell(pairs):
    """An ambiguity is said where all pairs of a robot leave it open; an error of any pair is said, once."""
    (first, second) = (pair for pair in pairs if "r1" in pair.robots)
    open_one = Finding("ambiguous-convention", "warning", ("r1",), "")
    wrong = Finding("robot-pose-inverted", "error", ("r1",), "")
    assert merge_findings([first, second], [[open_one], []]) == ()
    assert merge_findings([first, second], [[open_one], [open_one]]) == (open_one,)
    assert merge_findings([first, second], [[wrong], [wrong]]) == (wrong,)


@pytest.mark.slow
def test_a_mix_up_in_a_ring_is_named():
    """One of six robots whose poses are inverted is named alone; as recorded the ring is good."""
    assert calibrate(RING.cell, RING.recording).verdict == "good"
    found = calibrate(RING.cell, with_robots(RING.recording, {"r3": inverted}))
    assert found.verdict == "refused"
    named = {(f.code, f.about) for f in found.findings if f.severity == "error"}
    assert ("robot-pose-inverted", ("r3",)) in named
    assert all("r3" in about for code, about in named)


@pytest.mark.parametrize(("count", "many"), [(4, False), (5, True)])
def test_four_robots_are_looked_at_together(count, many):
    """Those that carry a camera or a target that is seen; the world is none."""
    robots = [f"r{k}" for k in range(count)]
    groups = [views(end(eye), end(hand)) for eye, hand in zip(robots, [None, *robots[:-1]], strict=True)]
    assert has_many_robots(problem_of(*groups)) == many


def test_a_pair_has_what_is_its_own(pairs):
    """Its samples with its robots alone and its one view, its lens, its transforms; of the eye the base is fixed."""
    for pair in pairs:
        (camera,), (target,) = pair.reading.cell.cameras, pair.reading.cell.targets
        assert set(pair.reading.cell.robots) == {*pair.robots, RING.cell.reference}
        (group,) = pair.reading.problem.groups
        assert (group.camera, group.target) == (camera, target)
        assert sorted(pair.reading.order) == sorted(group.sample)
        assert set(pair.reading.tracks) == set(pair.reading.cell.robots)
        assert set(pair.state.cameras) == {camera}
        assert set(pair.state.transforms) == set(pair.reading.cell.transforms)
        assert len(pair.state.stop_errors) == 0


def test_only_pairs_of_the_same_robot_tell_what_one_leaves_open(pairs):
    """A pair of others that says nothing is no witness; of two findings of one code each has its own robot."""
    first = next(pair for pair in pairs if "r1" in pair.robots)
    apart = next(pair for pair in pairs if not pair.robots & first.robots)
    one = Finding("ambiguous-convention", "warning", ("r1",), "")
    other = Finding("ambiguous-convention", "warning", (min(apart.robots),), "")
    assert merge_findings([first, apart], [[one], []]) == (one,)
    assert merge_findings([first, apart], [[one], [other]]) == (one, other)
    assert merge_findings([first, apart, first], [[one], [other], []]) == (other,)


def of_pair(eye, hand, camera, target, count=1):
    """A group of so many views."""
    at = SE3.identity((count,))
    return views(end(eye, at), end(hand, at), camera=camera, target=target)


def test_pairs_with_most_that_no_other_has_come_first():
    """Then those with most views; a pair that has nothing new is left out, and so are the world's."""
    groups = [
        of_pair("a", None, "ca", "world board"),
        of_pair("a", "b", "ca", "tb", count=3),
        of_pair("a", "b", "ca2", "tb", count=5),
        of_pair("c", "d", "cc", "td", count=4),
        of_pair("c", "b", "cc", "tb", count=50),
    ]
    found = [groups.index(group) for group in _covering(groups)]
    assert found == [4, 0, 3, 2]
