"""The truth of a running cell: its transforms, the kinematics of the arms, and faults."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from zlib import crc32

import numpy as np

from basecal.cell import WORLD, Cell
from basecal.effects.registry import EFFECTS
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.geometry import SE3, Array, Camera
from basecal.simulation.running.faults import Faults

_ROTATION_RAD_PER_M = 1.0  # rotation of a pushed body per translation: 1 mrad/mm
_FAULTS = {name: effect.fault for name, effect in EFFECTS.items() if effect.fault is not None}


@dataclass(frozen=True, eq=False)
class World:
    """True state of a cell.

    Attributes:
        cell: The stated cell.
        truth: True transforms of the cell, before any body is pushed.
        lenses: True lenses, by camera.
        robots: True kinematics, by robot.
        home: Initial joints of the arms, (n,) [rad], by robot.
        faults: Faults of the cell.
        pushed: Motions by which `truth` is multiplied on the right after a push, by name of the transform.
        seed: Seed of all noise.
    """

    cell: Cell
    truth: Mapping[str, SE3]
    lenses: Mapping[str, Camera]
    robots: Mapping[str, Kinematics]
    home: Mapping[str, Array]
    faults: Faults
    pushed: Mapping[str, SE3] = field(default_factory=dict)
    seed: int = 0

    def transform(self, name: str, is_pushed: bool) -> SE3:
        """A true transform before or after a push."""
        return self.truth[name] @ self.pushed[name] if is_pushed and name in self.pushed else self.truth[name]

    def gravity_motion(self, down_in_flange: Array) -> SE3:
        """Motion of a flange's load by gravity, from the direction of gravity in the flange, (3,)."""
        faults = _FAULTS.values()
        moves = (fault.move_mount(self.faults.size(fault.name), down_in_flange) for fault in faults if fault.move_mount)
        return SE3.exp(sum(moves, np.zeros(6)))


def faulty_world(cell: Cell, truth: Mapping[str, SE3], home: Mapping[str, Array], faults: Faults, seed: int) -> World:
    """Draw the faults of a cell.

    Args:
        cell: The stated cell, whose robots have chains and whose cameras have lenses.
        truth: True transforms.
        home: Initial joints of the arms, (n,) [rad], by robot.
        faults: Faults of the cell.
        seed: Seed of the draws, and of all noise.
    """
    rng = np.random.default_rng([seed, 7])
    robots = {}
    for name, robot in cell.robots.items():
        assert robot.chain is not None
        robots[name] = Kinematics(robot.chain, _parameters(name, robot.chain.n, faults, seed))
    pushed = {}
    bases = [cell.base_name(name) for name in cell.robots if name != cell.reference]
    mounts = [cell.mount_name(name) for name, target in cell.targets.items() if target.on != WORLD]
    for fault, movable in (("base-bumped", bases), ("board-remounted", mounts)):
        size, direction = faults.size(fault), rng.standard_normal(6)
        if size and movable:
            unit = np.concatenate([direction[:3] / np.linalg.norm(direction[:3]), direction[3:]])
            unit[3:] *= _ROTATION_RAD_PER_M / np.linalg.norm(direction[3:])
            pushed[movable[0]] = SE3.exp(size * unit)
    lenses = {name: each.intrinsics.camera for name, each in cell.cameras.items() if each.intrinsics}
    true_lenses = {name: _true_lens(lens, faults) for name, lens in lenses.items() if lens is not None}
    return World(cell, truth, true_lenses, robots, home, faults, pushed, seed)


def _true_lens(stated_lens: Camera, faults: Faults) -> Camera:
    """The true lens: the stated lens with its faults."""
    lens = stated_lens
    for fault in _FAULTS.values():
        if fault.true_lens is not None and faults.size(fault.name):
            lens = fault.true_lens(faults.size(fault.name), lens)
    return lens


def _parameters(robot: str, joints: int, faults: Faults, seed: int) -> dict[str, Array]:
    """True values of a robot's faulty parameters; each effect has its own random numbers."""
    values = {}
    for name, fault in _FAULTS.items():
        if fault.draw is not None and faults.size(fault.name):
            rng = np.random.default_rng([seed, 7, crc32(f"{robot} {name}".encode())])
            values[name] = fault.draw(faults.size(fault.name), joints, rng)
    return values
