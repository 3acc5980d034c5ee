"""Tests of candidate effects."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.effects.faces.candidates import (
    Candidates,
    combine_candidates,
    elapsed_share,
    frame_candidates,
    mount_moves,
    one_candidate,
    robot_moves,
)
from basecal.simulation import Scenario
from made_views import views_of

MOUNT = "eye_flange_from_wrist"
SCENARIO = Scenario(samples=6, target="led")


def test_single_candidate_keeps_its_own_fields():
    """`single` keeps the name, first sample, joint and moves of one candidate."""
    moves = (np.arange(24.0).reshape(2, 2, 6, 1), np.arange(36.0).reshape(3, 2, 6, 1))
    one = Candidates("drift", ("eye", "hand"), (None, 4), "m", moves).single(1)
    assert (one.code, one.about, one.since, one.unit) == ("drift", ("hand",), (4,), "m")
    assert one.joint == ()
    assert Candidates("joint-offset", ("eye",) * 2, (None,) * 2, "rad", moves, (0, 3)).single(1).joint == (3,)
    for part, whole in zip(one.moves, moves, strict=True):
        np.testing.assert_array_equal(part, whole[:, [1]])
    first = Candidates("drift", ("eye", "hand"), (None, 4), "m", moves, (2, 3)).single(0)
    assert (first.joint, [m.shape[1] for m in first.moves]) == ((2,), [1, 1])


def test_one_candidate_has_single_moves():
    """Groups that the candidate does not move stay None."""
    found = one_candidate("drift", "eye", "m", (np.ones((3, 6, 2)), None))
    assert (found.about, found.since, found.sizes, found.moves[1]) == (("eye",), (None,), 2, None)
    assert found.moves[0].shape == (3, 1, 6, 2)


def test_join_sizes_combines_candidates():
    """`join_sizes` keeps the order of the candidates; groups that none of them moves stay None."""
    moves = np.arange(48.0).reshape(2, 2, 6, 2)
    joined = Candidates("drift", ("eye", "hand"), (None, 4), "m", (moves, None)).join_sizes()
    assert (joined.about, joined.sizes, joined.moves[1]) == (("eye",), 4, None)
    np.testing.assert_array_equal(joined.moves[0][:, 0], np.concatenate([moves[:, 0], moves[:, 1]], axis=-1))
    assert joined.moves[0].shape == (2, 1, 6, 4)


def test_combine_candidates_of_several_kinds():
    """A candidate's sizes are zero in a group that it does not move, and every group has all sizes."""
    views = SimpleNamespace(groups=([0] * 2, [0] * 3))
    first, second = np.ones((2, 6, 2)), 2 * np.ones((3, 6, 1))
    both = combine_candidates(
        [one_candidate("a", "eye", "m", (first, None)), one_candidate("b", "eye", "m", (None, second))], views
    )
    assert [of.shape for of in both.moves] == [(2, 1, 6, 3), (3, 1, 6, 3)]
    np.testing.assert_array_equal(both.moves[0][:, 0], first @ np.eye(2, 3))
    np.testing.assert_array_equal(both.moves[1][:, 0], second @ np.eye(3)[2:])


def test_robot_moves_are_limited_to_carried_views():
    """Only views with an end on the robot are moved, by the function's result for their group."""
    views = views_of(SCENARIO)
    assert robot_moves(views, "eye", lambda _, k, robot: (k, robot)) == ((0, "eye"),)
    assert robot_moves(views, "nobody", lambda *_: pytest.fail("nobody carries anything")) == (None,)


@pytest.mark.parametrize("status", ["free", "fixed"])
def test_free_mount_absorbs_mean_of_gravity(status):
    """The mean over all poses moves nothing for a free mount; a fixed mount is stated without gravity."""
    views = views_of(replace(SCENARIO, camera_mount=status))
    pulls = []

    def move(down):
        """Return a rotation by each direction of gravity."""
        pulls.append(down)
        return np.concatenate([np.zeros((len(down), 3, 1)), down[..., None]], axis=1)

    (moved,) = mount_moves(views, MOUNT, move)
    down = views.down_in_flange(0, "eye")
    np.testing.assert_allclose(pulls[0], down - (0.0 if status == "fixed" else down.mean(0)), atol=1e-15)
    np.testing.assert_allclose(moved, views.flange_jacobian(0, "eye") @ move(pulls[0]))
    assert mount_moves(views, "hand_flange_from_board", move)[0].shape == (6, 6, 1)


def test_elapsed_share_runs_from_zero_to_one():
    """The share is that of the time from first to last sample; it is zero if all samples are simultaneous."""
    np.testing.assert_allclose(elapsed_share(SimpleNamespace(times=np.array([3.0, 4.0, 7.0]))), [0, 0.25, 1])
    assert elapsed_share(SimpleNamespace(times=np.array([3.0, 3.0]))).tolist() == [0, 0]


def test_point_mount_has_no_rotation_moves():
    """A point's mount has three tangents, another one six; views that do not depend on a frame have no moves."""
    views = views_of(SCENARIO)
    whole = np.ones((len(views.samples), 1))
    assert frame_candidates("step", views, "hand_flange_from_board", whole).moves[0].shape == (6, 1, 6, 3)
    assert frame_candidates("step", views, MOUNT, whole).moves[0].shape == (6, 1, 6, 6)
    assert frame_candidates("step", views, "left_flange_from_other", whole).moves == (None,)


def test_frame_candidates_scale_by_share():
    """Several candidates at once each have their own share of each sample, and their own first sample."""
    views = views_of(SCENARIO)
    shares = np.random.default_rng(0).uniform(0, 1, (6, 2))
    found = frame_candidates("step", views, MOUNT, shares, (3, None))
    assert (found.code, found.about, found.since, found.unit) == ("step", (MOUNT,) * 2, (3, None), "")
    (group,) = views.groups
    by_frame = views.frame_jacobian(0, MOUNT)
    for k in range(2):
        wanted = shares[views.sample_indices(group), k][:, None, None] * by_frame
        np.testing.assert_allclose(found.moves[0][:, k], wanted)


def test_joined_candidates_take_first_name():
    """Joined candidates have the name and first sample of the first one, and no joint."""
    moves = (np.arange(2.0 * 3 * 6 * 2).reshape(2, 3, 6, 2), None)
    joined = Candidates("code", ("a", "b", "c"), (4, 5, 6), "rad", moves, (0, 1, 2)).join_sizes()
    assert (joined.code, joined.about, joined.since, joined.unit, joined.joint) == ("code", ("a",), (4,), "rad", ())
    assert joined.sizes == 6
    np.testing.assert_array_equal(joined.moves[0][1, 0, :, 2:4], moves[0][1, 1])
    assert joined.moves[1] is None


def test_frame_candidates_have_six_axes():
    """Each candidate moves along six axes by its own share, with its own first sample."""
    views = views_of(Scenario(samples=6))
    shares = np.stack([np.ones(6), np.arange(6.0)], axis=-1)
    found = frame_candidates("step", views, MOUNT, shares, (None, 3))
    assert (found.about, found.since, found.sizes) == ((MOUNT, MOUNT), (None, 3), 6)
    by_frame = views.frame_jacobian(0, MOUNT)
    np.testing.assert_array_equal(found.moves[0][:, 0], by_frame)
    np.testing.assert_allclose(found.moves[0][:, 1], np.arange(6.0)[:, None, None] * by_frame)
    assert frame_candidates("step", views, MOUNT, shares[:, :1]).since == (None,)
