"""`too-few-samples`: no view left to check the others by."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.pose_problem import MOUNT, TARGET, pose_problem

from basecal.accuracy.findings.evidence import Input
from basecal.accuracy.findings.too_few_samples import too_few_samples
from basecal.cell import Finding, Unknown
from basecal.geometry import SE3


def messages(problem, unit_count=0):
    found = too_few_samples(Input(problem, (), unit_count=unit_count))
    assert {f.severity for f in found} <= {"error"}
    return [f.message for f in found]


@pytest.mark.parametrize(("views", "found"), [(2, False), (3, False)])
def test_one_unknown_pose_needs_two_views(views, found):
    """Six unknowns and views of six equations: without the largest there are enough from two on."""
    assert bool(messages(pose_problem(np.zeros((views, 6)), np.ones(6))[0])) == found


@pytest.mark.parametrize(("views", "found"), [(2, True), (3, False)])
def test_two_unknown_poses_need_three(views, found):
    """Equations and unknowns are told; what a prior holds is no unknown."""
    problem, _ = pose_problem(np.zeros((views, 6)), np.ones(6))
    columns = {MOUNT: slice(0, 6), TARGET: slice(6, 12)}
    free = replace(problem, columns=columns, unknowns={MOUNT: Unknown(), TARGET: Unknown()})
    told = messages(free)
    assert bool(told) == found
    assert not found or told[0].startswith("2 samples give 12 equations for 12 unknowns: too few to check each")
    held = {MOUNT: Unknown(), TARGET: Unknown("prior", SE3.identity(), np.ones(6))}
    assert messages(replace(free, unknowns=held)) == []


def test_a_unit_is_an_unknown():
    """Three views of two poses are checked by none if their length unit is unknown."""
    problem, _ = pose_problem(np.zeros((3, 6)), np.ones(6))
    columns = {MOUNT: slice(0, 6), TARGET: slice(6, 12)}
    free = replace(problem, columns=columns, unknowns={MOUNT: Unknown(), TARGET: Unknown()})
    assert messages(free) == []
    assert messages(free, unit_count=1)[0].startswith("3 samples give 18 equations for 13 unknowns")


def test_a_second_view_from_one_place_checks_nothing():
    """Three views of which two are from one place are two for twelve unknowns: their copy shows noise alone."""
    problem, _ = pose_problem(np.zeros((3, 6)), np.ones(6))
    free = replace(problem, columns={MOUNT: slice(0, 6), TARGET: slice(6, 12)})
    free = replace(free, unknowns={MOUNT: Unknown(), TARGET: Unknown()})
    group = free.groups[0]
    assert messages(free) == messages(free.with_groups([group, group.take(np.zeros(0, dtype=np.int64))])) == []
    revisited = group.with_ends(lambda end: replace(end, stop_number=np.minimum(end.stop_number, 1)))
    told = messages(free.with_groups([revisited]))
    assert told[0].startswith("3 samples at 2 places give 12 equations for 12 unknowns")
    at_rest = group.with_ends(lambda end: replace(end, stop_number=np.zeros_like(end.stop_number)))
    assert messages(free.with_groups([at_rest]))[0].startswith("3 samples at one place give 6 equations")


def test_one_sample_is_too_few():
    """And so is none, however little is unknown."""
    one, _ = pose_problem(np.zeros((1, 6)), np.ones(6))
    fixed = replace(one, columns={})
    assert messages(fixed)[0].startswith("Only one sample has a view of a target")
    assert messages(fixed.with_groups([]))[0].startswith("No sample has a view of a target")


@pytest.mark.parametrize(("sigma", "few"), [(None, True), (np.ones(6), False)])
def test_free_parameters_of_robots_are_unknowns(sigma, few):
    """Six offsets beside a pose leave nothing to check three views by; those that a prior holds do not count."""
    problem, _ = pose_problem(np.zeros((2, 6)), np.ones(6))
    model = SimpleNamespace(widths={"eye_joint_offsets": 6}, sigmas={"eye_joint_offsets": sigma})
    told = messages(replace(problem, models={"eye": model}))
    assert bool(told) == few
    assert not few or told[0].startswith("2 samples give 12 equations for 12 unknowns")


def test_images_that_were_not_searched_are_named():
    """Without a view the call that finds targets is named, unless a search has found none."""
    problem, _ = pose_problem(np.zeros((1, 6)), np.ones(6))
    empty = problem.with_groups([])
    (found,) = too_few_samples(SimpleNamespace(problem=empty, findings=(), image_count=20))
    assert found.what == "No target was searched in the 20 images of the recording."
    assert "basecal.detect(cell, recording)" in found.do[0]
    (single,) = too_few_samples(SimpleNamespace(problem=empty, findings=(), image_count=1))
    assert single.what == "No target was searched in the 1 image of the recording."
    missed = Finding("dropped-sample", "info", ("wrist", "board"), "board was not found")
    (found,) = too_few_samples(SimpleNamespace(problem=empty, findings=(missed,), image_count=20))
    assert found.what.startswith("No sample has a view of a target")
