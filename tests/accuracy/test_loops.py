"""Loops of robots and cameras close to their noise, and a pair that contradicts opens those it is part of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.loops import closed_loops
from basecal.accuracy.verdict import calibrate
from basecal.estimation.solve import solve
from basecal.reporting.text import text_report
from basecal.simulation import Scenario, simulate

RING = Scenario(samples=60, layout="chain", robots=4)


def test_a_ring_of_four_robots_closes():
    """One loop through all bases and pairs; without noise exactly, with 0.2 px to 5 mm and 5 mrad.

    Each pair has 15 samples for three transforms: bases known to 0.5 mm and 0.5 mrad, four times, a metre apart.
    """
    for noise, limit in ((0.2, 5e-3), (0.0, 1e-8)):
        made = simulate(replace(RING, pixel_px=noise), 0)
        (loop,) = closed_loops(solve(made.cell, made.recording))
        assert sorted(loop.bases) == ["r1_base", "r2_base", "r3_base", "r4_base"]
        assert sorted(loop.pairs) == [f"camera{k + 1} > board{(k + 1) % 4 + 1}" for k in range(4)]
        assert loop.length_m < limit
        assert loop.angle_rad < limit


def test_a_pair_that_contradicts_opens_its_loop():
    """One robot's poses are recorded 20 mm off while it shows its target, and right while it looks: the loop tells."""
    made = simulate(RING, 0)
    samples = [
        replace(s, robots={**s.robots, "r2": _shifted(s.robots["r2"])}) if s.observations[0].target == "board2" else s
        for s in made.recording.samples
    ]
    found = calibrate(made.cell, replace(made.recording, samples=tuple(samples)))
    (loop,) = found.residuals.loops
    assert loop.length_m == pytest.approx(0.02, rel=0.2)
    assert "closes to" in text_report(made.cell, found)


def _shifted(state):
    pose = state.base_from_flange
    return replace(state, base_from_flange=replace(pose, translation=pose.translation + np.array([0.02, 0, 0])))


@pytest.mark.parametrize("layout", ["dual", "eye_in_hand", "two_cameras", "two_world_cameras"])
def test_where_no_bases_close_there_is_no_loop(layout):
    """One pair; two robots that look at the world of the first; two cameras on the world: trees, or one base."""
    made = simulate(Scenario(samples=20, layout=layout), 0)
    solution = solve(made.cell, made.recording)
    assert closed_loops(solution) == ()


def test_two_cameras_on_one_arm_close_a_loop_of_two():
    """Both see the same, so that what is left is nothing."""
    made = simulate(Scenario(samples=20), 0)
    twin = replace(made.cell.cameras["wrist"], name="second")
    cell = replace(made.cell, cameras={**made.cell.cameras, "second": twin})
    samples = [
        replace(s, observations=(*s.observations, *(replace(o, camera="second") for o in s.observations)))
        for s in made.recording.samples
    ]
    (loop,) = closed_loops(solve(cell, replace(made.recording, samples=tuple(samples))))
    assert set(loop.pairs) == {"wrist > board", "second > board"}
    assert set(loop.bases) == {"eye_base", "hand_base"}
    assert loop.length_m < 1e-8
