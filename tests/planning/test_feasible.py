"""Whether a sample can be taken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import RobotState, Sample
from basecal.geometry import SE3
from basecal.planning.feasible import feasible_in, in_view, is_clear, within_limits
from basecal.planning.reach import state_at
from basecal.planning.sketch import sketch_of
from basecal.simulation.running.two_arms import two_arms
from shared.running_cell import home

WORLD = two_arms()
SKETCH, HOME = sketch_of(WORLD.cell), home(WORLD)


def moved(**tangents):
    """The home with flanges moved by tangents in their own axes."""
    states = dict(HOME)
    for robot, tangent in tangents.items():
        flange = SKETCH.base_from_flange(robot, HOME[robot]) @ SE3.exp(np.array(tangent, dtype=float))
        states[robot] = state_at(WORLD.cell.robots[robot], flange, HOME[robot])
    return Sample(0, robots=states)


def test_home_is_feasible():
    """Where the arms begin, everything is in order."""
    assert feasible_in(SKETCH)(Sample(0, robots=HOME))


@pytest.mark.parametrize(
    "tangents",
    [{"hand": [-0.35, 0, 0, 0, 0, 0]}, {"hand": [0, 0, 0, 0, 1.4, 0]}, {"eye": [0, 0, 0, 0.6, 0, 0]}],
    ids=["aside", "from the side", "looking away"],
)
def test_what_is_out_of_view(tangents):
    """A board that leaves the picture, or is seen too flat, is not in view."""
    assert in_view(SKETCH, Sample(0, robots=HOME))
    assert not in_view(SKETCH, moved(**tangents))


def test_arms_that_meet():
    """With bases nearer to one another the board comes within the room of a link, and that is not clear."""
    sample, base = Sample(0, robots=HOME), SKETCH.transforms["eye_base_from_hand_base"]

    def nearer(m):
        closer = SE3(np.eye(3), np.array([-m, 0.0, 0.0])) @ base
        return replace(SKETCH, transforms={**SKETCH.transforms, "eye_base_from_hand_base": closer})

    assert is_clear(nearer(0.3), sample)
    assert not is_clear(nearer(0.6), sample)


def test_limits():
    """Joints beyond a limit are out."""
    joints = WORLD.home["eye"].copy()
    joints[2] = 3.2
    assert within_limits(SKETCH, Sample(0, robots=HOME))
    assert not within_limits(SKETCH, Sample(0, robots={**HOME, "eye": RobotState(joints_rad=joints)}))
