"""Tests of layouts: the carriers of cameras and targets, and their views."""

from __future__ import annotations

from typing import get_args

import pytest

from basecal.cell.cell import WORLD
from basecal.simulation.layout import make_layout
from basecal.simulation.scenario import LayoutName


@pytest.mark.parametrize("name", get_args(LayoutName))
def test_every_layout_is_complete(name):
    """All carriers exist, every camera and target is in a view, and every robot moves."""
    plan = make_layout(name)
    views = [view for group in plan.groups for view in group]
    assert {camera for camera, _ in views} == plan.cameras.keys()
    assert {target for _, target in views} == plan.targets.keys()
    assert {plan.carrier(end) for view in views for end in view} <= {*plan.robots, WORLD}
    assert {robot for group in plan.groups for robot in plan.movers(group)} == set(plan.robots)


@pytest.mark.parametrize(
    ("name", "camera_on", "target_on"),
    [
        ("dual", "eye", "hand"),
        ("eye_in_hand", "arm", WORLD),
        ("eye_to_hand", WORLD, "arm"),
        ("two_cameras", "left", WORLD),
        ("two_world_cameras", WORLD, "arm"),
    ],
)
def test_layout_name_determines_carriers(name, camera_on, target_on):
    """The first view's camera and target are on the carriers that the name of the layout implies."""
    plan = make_layout(name)
    camera, target = plan.groups[0][0]
    assert (plan.carrier(camera), plan.carrier(target)) == (camera_on, target_on)


def test_chain_closes_to_a_ring():
    """Each robot observes the next, the last one the first.

    The pairs follow one another, the robot with the camera first.
    """
    plan = make_layout("chain", 4)
    assert plan.robots == ("r1", "r2", "r3", "r4")
    assert [plan.movers(group) for group in plan.groups] == [("r1", "r2"), ("r2", "r3"), ("r3", "r4"), ("r4", "r1")]
    assert plan.groups[-1] == (("camera4", "board1"),)


def test_movers_are_unique_with_cameras_first():
    """The robots of two cameras that observe one board are listed once, in the order of the views."""
    plan = make_layout("two_cameras")
    assert plan.movers(plan.groups[0]) == ("left", "right")
    assert make_layout("dual").movers(make_layout("dual").groups[0]) == ("eye", "hand")


@pytest.mark.parametrize(
    ("name", "robots", "seen"),
    [
        ("grid", 4, [(1, 2), (3, 4), (1, 3), (2, 4)]),
        ("grid", 5, [(1, 2), (3, 4), (1, 3), (2, 4), (3, 5)]),
        ("grid", 9, [(1, 2), (2, 3), (4, 5), (5, 6), (7, 8), (8, 9), *((k, k + 3) for k in range(1, 7))]),
        ("ring", 2, [(1, 2), (2, 1)]),
        ("ring", 3, [(1, 2), (1, 3), (2, 3), (2, 1), (3, 1), (3, 2)]),
        ("ring", 4, [(1, 2), (1, 3), (2, 3), (2, 4), (3, 4), (3, 1), (4, 1), (4, 2)]),
        ("chain", 2, [(1, 2), (2, 1)]),
    ],
)
def test_robots_observe_their_neighbours(name, robots, seen):
    """In a grid the neighbours are those to the right and below, in a ring the next two.

    Only a chain records parked robots.
    """
    plan = make_layout(name, robots)
    assert plan.robots == tuple(f"r{k + 1}" for k in range(robots))
    assert plan.groups == tuple(((f"camera{a}", f"board{b}"),) for a, b in seen)
    assert plan.cameras == {f"camera{a}": f"r{a}" for a, _ in seen}
    assert plan.targets == {f"board{b}": f"r{b}" for _, b in seen}
    assert plan.records_all == (name == "chain")
