"""Arms in three dimensions on a local page."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import RobotState, Unknown
from basecal.planning.sketch import sketch_cell
from basecal.reporting.live.arms import ArmsView, lengths, links
from shared.facing_arms import facing_arms


@pytest.fixture(scope="module")
def world():
    return facing_arms()


def test_links_go_from_joint_to_joint(world):
    """From the base through all joints to the flange, each link as long at any joints as at zero."""
    sketch, joints = sketch_cell(world.cell), world.home["hand"]
    state, long = RobotState(joints_rad=joints), lengths(sketch, "hand")
    rods = links(sketch, "hand", state)
    halves = [0.5 * length * np.array([0.0, 1.0, 0.0]) for length in long]
    ends = [rod @ half for rod, half in zip(rods, halves, strict=True)]
    starts = [rod @ -half for rod, half in zip(rods, halves, strict=True)]
    base = sketch.world_from_base("hand")
    np.testing.assert_allclose(starts[0], base.translation, atol=1e-12)
    np.testing.assert_allclose(starts[1:], ends[:-1], atol=1e-12)
    np.testing.assert_allclose(ends[-1], (base @ sketch.base_from_flange("hand", state)).translation, atol=1e-12)
    for rod in rods:
        np.testing.assert_allclose(rod.rotation.T @ rod.rotation, np.eye(3), atol=1e-12)
        assert np.linalg.det(rod.rotation) == pytest.approx(1.0)


def test_a_robot_without_joints_has_no_links(world):
    """Where poses are recorded nothing is known of what is between base and flange."""
    sketch = sketch_cell(world.cell)
    robots = {**world.cell.robots, "hand": replace(world.cell.robots["hand"], chain=None)}
    without = replace(sketch, cell=replace(world.cell, robots=robots))
    assert lengths(without, "hand") == []
    assert links(without, "hand", RobotState(joints_rad=world.home["hand"])) == []


class Drawn:
    """What stands for a scene of NiceGUI and all in it: keeps where each thing was put."""

    def __init__(self):
        self.things, self.places, self.seen = [], [], []

    def __getattr__(self, name):
        def called(*given, **options):
            if name in ("scene", "group", "cylinder", "sphere", "line"):
                self.things.append(Drawn())
                return self.things[-1]
            if name == "move":
                self.places.append(given)
            if name == "visible":
                self.seen.append(given[0])
            return self

        return called

    def __enter__(self):
        return self

    def __exit__(self, *why):
        return None


def test_only_what_moved_is_put_anew(world):
    """Nothing is seen before it is known where it is; then arms, and with them camera and board, follow the states."""
    ui = Drawn()
    view = ArmsView(ui, world.cell)
    (scene,) = ui.things
    groups = [thing for thing in scene.things if thing.seen]
    assert len(groups) == 2 * 7 + 2
    assert all(group.seen == [False] for group in groups)
    states = {name: RobotState(joints_rad=joints) for name, joints in world.home.items()}
    view.renew(states)
    view.renew(states)
    assert all(group.seen[-1] is True and len(group.places) == 1 for group in groups)
    view.renew({**states, "hand": RobotState(joints_rad=world.home["hand"] + 0.1)})
    assert [len(group.places) for group in groups] == [1] * 7 + [2] * 7 + [1, 2]


def test_a_cell_of_which_too_little_is_known(world):
    """Is not drawn."""
    ui, bases = Drawn(), {"hand": Unknown("free", None)}
    view = ArmsView(ui, replace(world.cell, bases=bases))
    view.renew({name: RobotState(joints_rad=joints) for name, joints in world.home.items()})
    assert ui.things == []
