"""Poses of a target that another program measured in a camera, as what an import brings into a cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from basecal.cell import WORLD, Cell, PoseObservation
from basecal.errors import InputError, list_names
from basecal.exchange.importing.imported import Row
from basecal.geometry import SE3


@dataclass(frozen=True)
class Sight:
    """Which camera sees which target, and what carries them where the cell does not say."""

    camera: str
    target: str
    camera_on: str | None = None
    target_on: str | None = None


def seen_rows(rows: tuple[Row, ...], camera_from_target: SE3, sight: Sight) -> tuple[Row, ...]:
    """Rows with what the camera saw.

    Args:
        rows: What says where each belongs.
        camera_from_target: (n,) poses.
        sight: Names.
    """
    views = (PoseObservation(sight.camera, sight.target, camera_from_target[i]) for i in range(len(rows)))
    return tuple(replace(row, observations=(view,)) for row, view in zip(rows, views, strict=True))


def sight_entry(cell: Cell | None, sight: Sight) -> dict[str, Any]:
    """Entries of `cell.yaml` for a camera and a target; those it has already stay.

    A new camera is on the only robot. A new target is on the world, or on the only robot where the camera is not.

    Raises:
        InputError: if it is not clear what carries them, both are on one thing, or the cell says otherwise.
    """
    robots = () if cell is None else tuple(cell.robots)
    cameras = {} if cell is None else {name: camera.on for name, camera in cell.cameras.items()}
    targets = {} if cell is None else {name: target.on for name, target in cell.targets.items()}
    camera_on = _carrier("camera", sight.camera, sight.camera_on, cameras, robots)
    given = sight.target_on
    if given is None and camera_on != WORLD and sight.target not in targets:
        given = WORLD
    target_on = _carrier("target", sight.target, given, targets, robots)
    if camera_on == target_on:
        raise InputError(f"camera {sight.camera!r} and target {sight.target!r} are both on {camera_on!r}")
    carriers = [name for name in (camera_on, target_on) if name != WORLD]
    return {
        "robots": {name: {} for name in carriers},
        "cameras": {sight.camera: {} if sight.camera in cameras else _free(camera_on)},
        "targets": {sight.target: {} if sight.target in targets else _free(target_on)},
    }


def _carrier(
    kind: str, name: str, stated_carrier: str | None, carriers: Mapping[str, str], robots: tuple[str, ...]
) -> str:
    """The carrier of a camera or target."""
    if name in carriers:
        if stated_carrier not in (None, carriers[name]):
            raise InputError(f"{kind} {name!r} is on {carriers[name]!r} in cell.yaml, not on {stated_carrier!r}")
        return carriers[name]
    if stated_carrier is not None:
        return stated_carrier
    if len(robots) == 1:
        return robots[0]
    option = "--on" if kind == "camera" else "--target-on"
    choices = list_names([*robots, WORLD]) if robots else f"a robot or {WORLD}"
    raise InputError(f"{kind} {name!r} is new: say what carries it, {option} with one of: {choices}")


def _free(carrier: str) -> dict[str, Any]:
    return {"on": carrier, "mount": {"status": "free"}}
