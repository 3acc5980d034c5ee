"""The running cell of two arms, cached: the search for it takes longer than most tests."""

from __future__ import annotations

from functools import cache

from basecal.simulation.running.faults import Faults
from basecal.simulation.running.two_arms import two_arms
from basecal.simulation.running.world import World, faulty_world

_cached_arms = cache(two_arms)


def facing_arms(target: str = "charuco", seed: int = 0, faults: Faults | None = None) -> World:
    """The world of `two_arms`, with faults if given."""
    world = _cached_arms(target, seed)
    return world if faults is None else faulty_world(world.cell, world.truth, world.home, faults, seed)
