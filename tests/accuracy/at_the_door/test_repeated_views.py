"""A view that stands under two places of the robots."""

from __future__ import annotations

from dataclasses import replace

import pytest

from basecal.accuracy.at_the_door.repeated_views import repeated_views
from basecal.simulation import Scenario, simulate


def copied(made, *pairs):
    samples = list(made.recording.samples)
    for one, other in pairs:
        samples[other] = replace(samples[other], observations=samples[one].observations)
    return replace(made.recording, samples=tuple(samples))


@pytest.mark.parametrize("target", ["charuco", "pose", "points3d"])
def test_a_view_under_other_poses(target):
    """Each pair is told; a recording in order has none."""
    made = simulate(Scenario(samples=8, target=target), 0)
    assert repeated_views(made.cell, made.recording) == []
    (found,) = repeated_views(made.cell, copied(made, (1, 4), (2, 7)))
    assert (found.code, found.severity, found.about) == ("repeated-view", "warning", ("1", "4", "2", "7"))
    assert "at samples 1 and 4, samples 2 and 7: pair poses and pictures anew" in found.message


def test_of_many_pairs_five_are_listed():
    """And the others counted."""
    made = simulate(Scenario(samples=16), 0)
    (found,) = repeated_views(made.cell, copied(made, *((k, k + 8) for k in range(8))))
    assert "and 3 more pairs" in found.message


def test_where_nothing_that_matters_moved_it_is_no_mistake():
    """A copy of a whole row, a robot that carries neither, and a light, whose two numbers may be the same by chance."""
    made = simulate(Scenario(samples=6), 0)
    rows = list(made.recording.samples)
    rows[4] = replace(rows[1], sample=4)
    assert repeated_views(made.cell, replace(made.recording, samples=tuple(rows))) == []
    alone = simulate(Scenario(samples=6, layout="eye_in_hand"), 0)
    idle = {**alone.cell.robots, "idle": replace(next(iter(alone.cell.robots.values())), name="idle")}
    rows = [
        replace(row, robots={"arm": alone.recording.samples[0].robots["arm"], "idle": row.robots["arm"]})
        for row in copied(alone, (1, 4)).samples
    ]
    moved = replace(alone.recording, samples=tuple(rows))
    assert repeated_views(replace(alone.cell, robots=idle), moved) == []
    light = simulate(Scenario(samples=6, target="led"), 0)
    assert repeated_views(light.cell, copied(light, (1, 4))) == []
