"""Views of a grid that were read from the other end are found by what the robots turned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.problem.build import build_problem
from basecal.estimation.start.half_turns import turned_views
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
    turned_group = replace(group, hand_base_from_hand_flange=_turned(group, wide))
    mount = rotation_exp(np.array([0.3, -0.2, 2.0]))
    read = np.swapaxes(mount, -1, -2) @ wide @ mount @ rotation_exp(5e-3 * rng.standard_normal((count, 3)))
    flipped = rng.random(count) < 0.5
    seen = np.where(flipped[:, None, None], read @ HALF_TURN, read)
    found = turned_views(turned_group, seen, seen @ HALF_TURN)
    assert np.array_equal(found, flipped) or np.array_equal(found, ~flipped)


def _turned(group, rotation):
    return type(group.hand_base_from_hand_flange)(rotation, group.hand_base_from_hand_flange.translation)
