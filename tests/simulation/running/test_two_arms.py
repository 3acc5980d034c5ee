"""Two arms that face each other."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.simulation.running.plant import Clock, Plant
from basecal.simulation.running.two_arms import two_arms
from basecal.vision.detectors import find


@pytest.mark.parametrize("seed", range(3))
def test_the_target_is_seen_whole_from_where_they_begin(seed):
    """Every corner of the board is found in the first image; what the cell states is near the truth, not it."""
    world = two_arms("charuco", seed)
    board = world.cell.targets["board"].target
    found = find(Plant(world, Clock(0)).shot("wrist").image, board)
    assert len(found.pixels) == len(board.points)
    for name, unknown in world.cell.transforms.items():
        off = (world.truth[name].inverse() @ unknown.mean).log()
        assert 1e-3 < np.linalg.norm(off[:3]) < 0.1
        assert unknown.status == "free"


def test_a_light_has_known_mounts():
    """As the paper has it: mounts fixed as they are, the base free."""
    cell = two_arms("led", 1).cell
    assert {name: unknown.status for name, unknown in cell.transforms.items()} == {
        "eye_base_from_hand_base": "free",
        "eye_flange_from_wrist": "fixed",
        "hand_flange_from_light": "fixed",
    }
