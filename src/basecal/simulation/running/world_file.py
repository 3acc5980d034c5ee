"""Files of a running cell: the stated cell in `cell.yaml`, and the truth in `truth.yaml`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from basecal.cell import Cell
from basecal.cell.files import read_cell, read_truth, write_cell, write_truth
from basecal.cell.format.plain import numbers, pose_dict
from basecal.cell.format.writing import write_atomically
from basecal.cell.results.truth_file import FILE, read_truth_extra
from basecal.cell.schema.errors import check_entry
from basecal.errors import DatasetError
from basecal.exchange.urdf import chain_urdf
from basecal.fields.values import Entry, Number
from basecal.simulation.running.faults import FAULTS, Faults
from basecal.simulation.running.world import World, faulty_world


class RunningEntry(Entry):
    """Entry of `truth.yaml` for a cell that can run: initial joints of the arms, and the seed of all noise."""

    home_joints_rad: dict[str, Annotated[list[Number], Field(min_length=1)]]
    seed: int = 0


def write_world(world: World, folder: Path) -> None:
    """Write a cell that can run: `cell.yaml`, the arms' URDF files, and `truth.yaml`.

    Raises:
        InputError: if a file cannot be written.
    """
    write_urdfs(world.cell, folder)
    write_world_truth(world, folder)
    write_cell(world.cell, folder)


def write_urdfs(cell: Cell, folder: Path) -> None:
    """Write the URDF of each robot with joints.

    Raises:
        InputError: if a file cannot be written.
    """
    for robot in cell.robots.values():
        if robot.chain is not None and robot.urdf and robot.base_link and robot.flange_link:
            text = chain_urdf(robot.chain, robot.base_link, robot.flange_link, robot.name)
            write_atomically(folder / robot.urdf, text, base_folder=folder)


def write_world_truth(world: World, folder: Path) -> None:
    """Write `truth.yaml` with the cell's true transforms, its arms' parameters, and its faults."""
    faults = [
        {"name": each.name, "size": each.size / FAULTS[each.name].scale, "unit": FAULTS[each.name].unit}
        | ({"after_moves": each.after_moves} if FAULTS[each.name].is_sudden else {})
        for each in world.faults.faults
    ]
    pushed = {name: pose_dict(world.transform(name, is_pushed=True)) for name in world.pushed}
    extra: dict[str, Any] = {
        "running": {"home_joints_rad": {name: numbers(q) for name, q in world.home.items()}, "seed": world.seed},
        "faults": faults,
        "transforms_afterwards": pushed,
        "robot_parameters": {
            name: {kind: numbers(values) for kind, values in robot.values.items()}
            for name, robot in world.robots.items()
            if robot.values
        },
    }
    write_truth(folder, world.truth, **{key: value for key, value in extra.items() if value})


def read_world(folder: Path, faults: Faults | None = None) -> World:
    """Read the cell of a folder, and draw its faults.

    Raises:
        DatasetError: if the cell or its truth cannot be read, or lacks required data.
    """
    cell, truth = read_cell(folder), read_truth(folder)
    path = str(folder / FILE)
    running_data = read_truth_extra(folder).get("running")
    if running_data is None:
        message = "this cell has no data to run. Give a new folder, or state the initial joints of its arms"
        raise DatasetError(path, message, field="running.home_joints_rad")
    running = check_entry(RunningEntry, running_data, path, loc=("running",))
    home = {name: np.array(joints) for name, joints in running.home_joints_rad.items()}
    missing = [name for name in cell.transforms if name not in truth]
    if missing:
        raise DatasetError(path, f"lacks {missing[0]}, which the cell has", field="transforms")
    _check_drawable(cell, home, folder)
    return faulty_world(cell, truth, home, faults or Faults(), running.seed)


def _check_drawable(cell: Cell, home: dict[str, Any], folder: Path) -> None:
    path = str(folder / "cell.yaml")
    for name, robot in cell.robots.items():
        if robot.chain is None:
            raise DatasetError(path, "needs urdf, base_link and flange_link to be run", field=f"robots.{name}")
        if name not in home or len(home[name]) != robot.chain.n:
            message = f"expected {robot.chain.n} joints [rad]"
            raise DatasetError(str(folder / FILE), message, field=f"running.home_joints_rad.{name}")
    for name, camera in cell.cameras.items():
        if camera.size_px is None or camera.intrinsics is None or camera.intrinsics.camera is None:
            raise DatasetError(path, "needs size_px and a lens to be drawn", field=f"cameras.{name}.intrinsics")
