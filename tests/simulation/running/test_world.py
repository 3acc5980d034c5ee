"""Tests of the faults drawn for a world: each is present with its size, and no other is."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.simulation.running.faults import read_faults
from basecal.simulation.running.two_arms import two_arms

BASE, MOUNT = "eye_base_from_hand_base", "hand_flange_from_board"


def world(*faults):
    return two_arms(faults=read_faults(faults))


@pytest.mark.parametrize(
    ("fault", "kind", "sigma"),
    [
        ("joint-offsets=0.5", "joint_offsets", np.radians(0.5)),
        ("link-errors=2", "link_parameters", 0.002),
        ("sag=0.1", "deflection", np.radians(0.1) / 50),
    ],
)
def test_robot_faults_set_only_their_parameters(fault, kind, sigma):
    """Each arm has only the parameters of the fault, of its size within a factor of two, given the few numbers."""
    drawn = world(fault).robots
    assert all(list(robot.values) == [kind] for robot in drawn.values())
    values = np.concatenate([robot.values[kind].ravel() for robot in drawn.values()])
    if kind == "link_parameters":
        values = values.reshape(-1, 6)[:, :3].ravel()
    assert sigma / 2 < np.sqrt(np.mean(values**2)) < 2 * sigma


@pytest.mark.parametrize(("fault", "name"), [("base-bumped=4", BASE), ("board-remounted=4", MOUNT)])
def test_displacement_fault_has_its_size(fault, name):
    """Base or mount move by the size and rotate by a milliradian per millimetre, and all else is unchanged."""
    pushed = world(fault)
    assert set(pushed.pushed) == {name}
    moved = pushed.transform(name, is_pushed=False).inverse() @ pushed.transform(name, is_pushed=True)
    assert np.linalg.norm(moved.log()[:3]) == pytest.approx(0.004)
    assert np.linalg.norm(moved.log()[3:]) == pytest.approx(0.004)
    assert np.array_equal(pushed.transform(BASE, False).matrix, world().truth[BASE].matrix)


def test_world_without_faults_is_as_stated():
    """Without faults the arms are as stated and no object is displaced."""
    sound = world()
    assert not sound.pushed
    assert not any(robot.values for robot in sound.robots.values())


@pytest.mark.parametrize("fault", ["focal-length", "principal-point", "distortion"])
def test_lens_faults_change_only_the_true_lens(fault):
    """The cell states the unchanged lens."""
    wrong, right = world(fault), world()
    assert not np.array_equal(wrong.lenses["wrist"].parameters, right.lenses["wrist"].parameters)
    stated = wrong.cell.cameras["wrist"].intrinsics.camera
    np.testing.assert_array_equal(stated.parameters, right.lenses["wrist"].parameters)
