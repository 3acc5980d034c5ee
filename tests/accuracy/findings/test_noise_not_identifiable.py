"""Tests of the finding `noise-not-identifiable`: robot noise that the data do not determine."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.pose_problem import pose_problem

from basecal.accuracy.findings.noise_not_identifiable import (
    noise_not_identifiable,
    robots_with_few_stops,
    robots_with_one_stop,
)


def make_problem(stops, unstated=("eye",)):
    problem, _ = pose_problem(np.zeros((stops, 6)), np.ones(6))
    return replace(problem, unstated=frozenset(unstated))


@pytest.mark.parametrize(("stops", "few"), [(1, {}), (2, {"eye": 2}), (11, {"eye": 11}), (12, {})])
def test_two_to_eleven_stops_are_few(stops, few):
    """Two to eleven stops are few: a single stop has no noise of its own, and twelve are enough."""
    assert robots_with_few_stops(make_problem(stops)) == few


def test_robots_with_few_stops_are_named(evidence):
    """Robots with few stops are named if their noise is estimated; findings of the solver follow."""
    made = evidence({"findings": ("of the solver",)}, recorded=make_problem(5))
    few, other = noise_not_identifiable(made)
    assert (few.severity, few.about, other) == ("info", ("eye",), "of the solver")
    assert few.message.startswith("5 stops of eye are too few to estimate unstated noise.")
    made.settings = SimpleNamespace(robot_noise="stated")
    assert noise_not_identifiable(made) == ["of the solver"]
    assert noise_not_identifiable(evidence(recorded=make_problem(5, unstated=()))) == []


@pytest.mark.parametrize(("stops", "robots"), [(1, ["eye"]), (2, [])])
def test_single_stop_is_reported(evidence, stops, robots):
    """A single stop of a robot without stated noise is reported as such; two stops are few, but more than one."""
    assert robots_with_one_stop(make_problem(stops)) == robots
    assert robots_with_one_stop(make_problem(stops, unstated=())) == []
    (found,) = noise_not_identifiable(evidence(recorded=make_problem(stops)))
    assert (found.severity, found.about) == ("info", ("eye",))
    assert ("made a single stop" in found.message) == bool(robots)
