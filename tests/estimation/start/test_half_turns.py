"""Views of a grid that were read from the other end are found by what the robots turned."""

from __future__ import annotations

import numpy as np
import pytest
from tests.ends import end, views, with_hand

from basecal.estimation.problem.build import build_problem
from basecal.estimation.start.half_turns import _descend_readings, turned_views
from basecal.geometry import SE3
from basecal.geometry.rotation import rotation_exp
from basecal.simulation import Scenario, simulate

HALF_TURN = np.diag([-1.0, -1.0, 1.0])


@pytest.mark.parametrize("count", [4, 12])
def test_views_read_from_the_other_end_are_found_however_far_the_arm_turned(count):
    """One arm that turns by up to 3 rad, poses of views off by 5 mrad: all views are read from one and the same end."""
    s = simulate(Scenario(samples=count, arms="eye_still"), 2)
    (group,) = build_problem(s.cell, s.recording)[0].groups
    rng = np.random.default_rng(0)
    # The target turned as far as its arm, about axes of its own.
    wide = rotation_exp(rng.uniform(-1.7, 1.7, (count, 3)))
    turned_group = with_hand(group, base_from_flange=_turned(group, wide))
    mount = rotation_exp(np.array([0.3, -0.2, 2.0]))
    read = np.swapaxes(mount, -1, -2) @ wide @ mount @ rotation_exp(5e-3 * rng.standard_normal((count, 3)))
    flipped = rng.random(count) < 0.5
    seen = np.where(flipped[:, None, None], read @ HALF_TURN, read)
    found = turned_views(turned_group, seen, seen @ HALF_TURN)
    assert np.array_equal(found, flipped) or np.array_equal(found, ~flipped)


def _turned(group, rotation):
    return type(group.hand.base_from_flange)(rotation, group.hand.base_from_flange.translation)


def group_of(eye_stand, hand_stand, eye, hand):
    """Views of two arms by the stops that each stood in, their flanges turned so."""
    n = len(eye_stand)
    a, c = (SE3(np.broadcast_to(turn, (n, 3, 3)), np.zeros((n, 3))) for turn in (eye, hand))
    return views(end("eye", a, stand=eye_stand), end("hand", c, stand=hand_stand))


def about(angle_rad, axis=(0.6, 0.0, 0.8)):
    return rotation_exp(np.multiply.outer(angle_rad, axis))


@pytest.mark.parametrize("stands", [([0, 1, 2, 3], [0, 1, 2, 3]), ([0, 0, 0, 0], [0, 0, 0, 0])])
def test_where_no_robot_moved_alone_views_turn_least_against_the_first(stands):
    """Both moved between any two views, or neither: nothing tells by how much the target turned."""
    wide = about([0.0, 1.0, 1.7, 3.0], (0.0, 0.0, 1.0))
    found = turned_views(group_of(*stands, wide, about([0.0, 0.1, 0.2, 0.3])), wide, wide @ HALF_TURN)
    assert found.tolist() == [False, False, True, True]


@pytest.mark.parametrize("still", ["eye", "hand"])
def test_the_arm_that_moved_alone_tells_how_far_the_target_turned(still):
    """Whichever it is: by 3 rad, where the other end is nearer to the first view."""
    angle = np.array([0.0, 3.0, 2.5, 0.4, 2.0])
    moved, stood = about(angle, (0.0, 0.0, 1.0)), np.eye(3)
    stands, turns = ([0] * 5, [0, 1, 2, 3, 4]), (stood, moved)
    seen = moved if still == "eye" else moved.mT
    if still == "hand":
        stands, turns = stands[::-1], turns[::-1]
    found = turned_views(group_of(*stands, *turns), seen, seen @ HALF_TURN)
    assert found.tolist() in ([False] * 5, [True] * 5)
    flipped = np.array([False, True, False, True, True])
    mixed = np.where(flipped[:, None, None], seen @ HALF_TURN, seen)
    found = turned_views(group_of(*stands, *turns), mixed, mixed @ HALF_TURN)
    assert found.tolist() in (flipped.tolist(), (~flipped).tolist())


@pytest.mark.parametrize("count", [2, 3, 7])
def test_no_single_view_gains_by_being_read_otherwise(rng, count):
    """At the end of a descent; where it begins nothing is changed, and an end is kept as it is."""
    misfit = rng.uniform(size=(count, 2, count, 2))
    misfit = misfit + misfit.transpose(2, 3, 0, 1)
    misfit[np.arange(count), :, np.arange(count)] = 0.0
    rows, begun = np.arange(count), rng.integers(0, 2, count)
    start = begun.copy()

    def cost(turn):
        return misfit[rows, turn][:, rows, turn].sum()

    found = _descend_readings(misfit, begun)
    np.testing.assert_array_equal(begun, start)
    assert cost(found) <= cost(begun)
    for view in rows:
        other = np.where(rows == view, 1 - found, found)
        assert cost(other) >= cost(found) - 4e-6
    np.testing.assert_array_equal(_descend_readings(misfit, found), found)
