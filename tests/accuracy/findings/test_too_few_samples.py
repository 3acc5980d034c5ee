"""Tests of the finding `too-few-samples`: no redundant view is left."""

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
    """One unknown pose needs two views: six unknowns, six equations each, and the largest view is left out."""
    assert bool(messages(pose_problem(np.zeros((views, 6)), np.ones(6))[0])) == found


@pytest.mark.parametrize(("views", "found"), [(2, True), (3, False)])
def test_two_unknown_poses_need_three_views(views, found):
    """Two unknown poses need three views, and the message states equations and unknowns.

    A pose with a prior is no unknown.
    """
    problem, _ = pose_problem(np.zeros((views, 6)), np.ones(6))
    columns = {MOUNT: slice(0, 6), TARGET: slice(6, 12)}
    free = replace(problem, columns=columns, unknowns={MOUNT: Unknown(), TARGET: Unknown()})
    texts = messages(free)
    assert bool(texts) == found
    assert not found or texts[0].startswith("2 samples give 12 equations for 12 unknowns: too few to check each")
    held = {MOUNT: Unknown(), TARGET: Unknown("prior", SE3.identity(), np.ones(6))}
    assert messages(replace(free, unknowns=held)) == []


def test_length_unit_is_unknown():
    """A length unit is an unknown: three views of two poses are not redundant with it."""
    problem, _ = pose_problem(np.zeros((3, 6)), np.ones(6))
    columns = {MOUNT: slice(0, 6), TARGET: slice(6, 12)}
    free = replace(problem, columns=columns, unknowns={MOUNT: Unknown(), TARGET: Unknown()})
    assert messages(free) == []
    assert messages(free, unit_count=1)[0].startswith("3 samples give 18 equations for 13 unknowns")


def test_second_view_of_place_is_not_redundant():
    """A second view from one place shows only noise: three views from two places count as two."""
    problem, _ = pose_problem(np.zeros((3, 6)), np.ones(6))
    free = replace(problem, columns={MOUNT: slice(0, 6), TARGET: slice(6, 12)})
    free = replace(free, unknowns={MOUNT: Unknown(), TARGET: Unknown()})
    group = free.groups[0]
    assert messages(free) == messages(free.with_groups([group, group.take(np.zeros(0, dtype=np.int64))])) == []
    revisited = group.with_ends(lambda end: replace(end, stop_number=np.minimum(end.stop_number, 1)))
    texts = messages(free.with_groups([revisited]))
    assert texts[0].startswith("3 samples at 2 places give 12 equations for 12 unknowns")
    at_rest = group.with_ends(lambda end: replace(end, stop_number=np.zeros_like(end.stop_number)))
    assert messages(free.with_groups([at_rest]))[0].startswith("3 samples at one place give 6 equations")


def test_one_sample_is_too_few():
    """One sample is too few, and so is none, however few the unknowns."""
    one, _ = pose_problem(np.zeros((1, 6)), np.ones(6))
    fixed = replace(one, columns={})
    assert messages(fixed)[0].startswith("Only one sample has a view of a target")
    assert messages(fixed.with_groups([]))[0].startswith("No sample has a view of a target")


@pytest.mark.parametrize(("sigma", "few"), [(None, True), (np.ones(6), False)])
def test_free_robot_parameters_are_unknowns(sigma, few):
    """Six free joint offsets beside a pose leave no redundant view; those with a prior do not count."""
    problem, _ = pose_problem(np.zeros((2, 6)), np.ones(6))
    model = SimpleNamespace(widths={"eye_joint_offsets": 6}, sigmas={"eye_joint_offsets": sigma})
    texts = messages(replace(problem, models={"eye": model}))
    assert bool(texts) == few
    assert not few or texts[0].startswith("2 samples give 12 equations for 12 unknowns")


def test_unsearched_images_are_named():
    """Without a view, the call that finds targets is named, unless a search has found none."""
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
