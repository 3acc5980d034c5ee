"""The running cell of two arms, drawn once: it is found by a search that takes longer than most of what is tested."""

from __future__ import annotations

from functools import cache

from basecal.simulation.running.faults import Faults
from basecal.simulation.running.two_arms import two_arms
from basecal.simulation.running.world import World, faulty_world

_drawn = cache(two_arms)


def facing_arms(target: str = "charuco", seed: int = 0, faults: Faults | None = None) -> World:
    """As `two_arms` gives it."""
    world = _drawn(target, seed)
    return world if faults is None else faulty_world(world.cell, world.truth, world.home, faults, seed)
