"""Tests of cells of many robots, checked pair by pair."""

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


def test_two_arms_are_checked_together():
    """Two arms are one cell, a ring of six is many robots."""
    two = simulate(Scenario(samples=4), 1)
    assert not has_many_robots(build_problem(two.cell, two.recording)[0])
    assert has_many_robots(build_problem(RING.cell, RING.recording)[0])


def test_pairs_cover_all_devices(pairs):
    """Pairs cover each robot, camera and target with as few as needed: half of those in a ring with loops."""
    assert {name for pair in pairs for name in pair.robots} == RING.cell.robots.keys()
    assert {name for pair in pairs for name in pair.reading.cell.cameras} == RING.cell.cameras.keys()
    assert {name for pair in pairs for name in pair.reading.cell.targets} == RING.cell.targets.keys()
    assert len(pairs) == 6


def test_pair_determines_its_base(pairs):
    """A pair solved alone, with the eye's base fixed, gives the true base of the hand within six sigmas per axis."""
    for pair in pairs[:3]:
        found = solve_problem(pair.reading.problem, pair.reading.cell, Settings(robot_noise="stated"))
        name = pair.reading.cell.requested_transforms[0]
        estimate = found.transforms[name]
        off = (estimate.mean.inverse() @ RING.truth[name]).log() / np.sqrt(np.diag(estimate.covariance))
        assert np.abs(off).max() < 6


def test_ambiguity_needs_all_pairs_of_robot(pairs):
    """An ambiguity is reported only if all pairs of a robot have it; an error of any pair is reported once."""
    (first, second) = (pair for pair in pairs if "r1" in pair.robots)
    open_one = Finding("ambiguous-convention", "warning", ("r1",), "")
    wrong = Finding("robot-pose-inverted", "error", ("r1",), "")
    assert merge_findings([first, second], [[open_one], []]) == ()
    assert merge_findings([first, second], [[open_one], [open_one]]) == (open_one,)
    assert merge_findings([first, second], [[wrong], [wrong]]) == (wrong,)


@pytest.mark.slow
def test_mix_up_in_ring_is_named():
    """The one robot of six with inverted poses is named alone; the unchanged ring is good."""
    assert calibrate(RING.cell, RING.recording).verdict == "good"
    found = calibrate(RING.cell, with_robots(RING.recording, {"r3": inverted}))
    assert found.verdict == "refused"
    named = {(f.code, f.about) for f in found.findings if f.severity == "error"}
    assert ("robot-pose-inverted", ("r3",)) in named
    assert all("r3" in about for code, about in named)


@pytest.mark.parametrize(("count", "many"), [(4, False), (5, True)])
def test_four_robots_are_checked_together(count, many):
    """Up to four robots that carry a seen camera or target are checked together; the world is not one."""
    robots = [f"r{k}" for k in range(count)]
    groups = [views(end(eye), end(hand)) for eye, hand in zip(robots, [None, *robots[:-1]], strict=True)]
    assert has_many_robots(problem_of(*groups)) == many


def test_pair_contains_own_data_only(pairs):
    """A pair contains its samples with its robots and view, its lens and its transforms, with the eye's base fixed."""
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


def test_only_pairs_of_same_robot_resolve_ambiguity(pairs):
    """Only pairs of the same robot resolve its ambiguity; two findings of one code keep their own robots."""
    first = next(pair for pair in pairs if "r1" in pair.robots)
    apart = next(pair for pair in pairs if not pair.robots & first.robots)
    one = Finding("ambiguous-convention", "warning", ("r1",), "")
    other = Finding("ambiguous-convention", "warning", (min(apart.robots),), "")
    assert merge_findings([first, apart], [[one], []]) == (one,)
    assert merge_findings([first, apart], [[one], [other]]) == (one, other)
    assert merge_findings([first, apart, first], [[one], [other], []]) == (other,)


def of_pair(eye, hand, camera, target, count=1):
    """A group of the given number of views."""
    at = SE3.identity((count,))
    return views(end(eye, at), end(hand, at), camera=camera, target=target)


def test_pairs_with_most_new_devices_come_first():
    """Pairs with the most new devices come first, then those with most views; pairs without new ones are omitted."""
    groups = [
        of_pair("a", None, "ca", "world board"),
        of_pair("a", "b", "ca", "tb", count=3),
        of_pair("a", "b", "ca2", "tb", count=5),
        of_pair("c", "d", "cc", "td", count=4),
        of_pair("c", "b", "cc", "tb", count=50),
    ]
    found = [groups.index(group) for group in _covering(groups)]
    assert found == [4, 0, 3, 2]
