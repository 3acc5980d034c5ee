"""Swapped carriers of the camera and target of one robot, which fit exactly as well as inverted robot poses."""

from __future__ import annotations

from collections.abc import Mapping

from basecal.cell import WORLD, Cell
from basecal.fields.problems import Loc


def swap_carriers(cell: Cell, robots: tuple[str, ...]) -> dict[Loc, str]:
    """Carriers of all cameras and targets with robot and world swapped, by location in `cell.yaml`.

    Empty if inverted poses do not give the same loops: with several robots, or if a mount is known.
    """
    if robots != tuple(cell.robots) or len(robots) != 1 or cell.sees_scene or cell.plates:
        return {}
    mounts = {("cameras", name): (camera.on, camera.mount) for name, camera in cell.cameras.items()}
    mounts |= {("targets", name): (target.on, target.mount) for name, target in cell.targets.items()}
    swapped = {robots[0]: WORLD, WORLD: robots[0]}
    if any(camera.touches for camera in cell.cameras.values()):
        return {}
    if any(mount.status != "free" or on not in swapped for on, mount in mounts.values()):
        return {}
    return {(*place, "on"): swapped[on] for place, (on, _) in mounts.items()}


def describe_carriers(carriers: Mapping[Loc, str]) -> str:
    """Describe carriers, such as "camera is on hand and target on world"."""
    first, *others = [f"{place[1]} is on {on}" for place, on in carriers.items()]
    return " and ".join([first, *(each.replace(" is on ", " on ") for each in others)])
