"""When robots that do not stand still pass the poses of views."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import Clock
from basecal.estimation.problem.build import build_problem
from basecal.estimation.streams.passing import with_passing_times
from basecal.estimation.streams.streams import recording_streams, synchronise
from stream_cells import streamed


def passed(still: bool):
    """The end of the arm, and the stamps of its views."""
    made = streamed(clock=Clock(offset_s=0.03), still=still)
    streams = recording_streams(made.cell, made.recording)
    of = synchronise(streams, streams.stated_offsets)
    (group,) = with_passing_times(build_problem(made.cell, of.recording)[0], of, made.cell).groups
    stamps = {sample.sample: sample.stamp_s for sample in of.recording.samples}
    return group, [stamps[number] for number in group.sample.tolist()]


def test_on_a_path_they_are_the_instants_of_the_views():
    """By the clock of the arm; the world, which carries the tag, passes nothing."""
    group, stamps = passed(still=False)
    np.testing.assert_array_equal(group.eye.passed_s, stamps)
    assert group.hand.passed_s is None
    np.testing.assert_array_equal(group.take(np.array([3, 5])).eye.passed_s, np.array(stamps)[[3, 5]])


@pytest.mark.parametrize(
    ("still", "sigma", "is_total", "is_open"),
    [(False, 1e-4, False, True), (False, 1e-4, True, False), (True, 1e-4, False, False), (False, 0.0, False, False)],
)
def test_a_repeatability_says_nothing_of_an_arm_that_moves(still, sigma, is_total, is_open):
    """Its noise is open on a path, unless it states all its errors, or none at all."""
    made = streamed(still=still)
    arm = replace(made.cell.robots["arm"], noise=np.full(6, sigma), is_total_noise=is_total)
    cell = replace(made.cell, robots={"arm": arm})
    of = synchronise(streams := recording_streams(cell, made.recording), streams.stated_offsets)
    problem = with_passing_times(build_problem(cell, of.recording)[0], of, cell)
    assert ("arm" in problem.unstated) == is_open
    assert set(problem.stops.robot) == ({"arm"} if sigma else set())


def test_where_the_arm_stands_there_is_none():
    """Views at stops of a stream have errors of their own, as separate samples have."""
    group, _ = passed(still=True)
    assert np.isnan(group.eye.passed_s).all()
