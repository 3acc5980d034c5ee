"""The arms of a cell in three dimensions on a local page, as they stand now and as the cell knows it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from itertools import pairwise
from typing import Any

import numpy as np

from basecal.cell import WORLD, Cell, RobotState
from basecal.errors import BasecalError
from basecal.geometry import SE3, Array
from basecal.planning.sketch import Sketch, sketch_cell
from basecal.reporting.cell_view.scene import frustum, outline

_SIZE_PX = 420
_ROD_M, _JOINT_M = 0.035, 0.05  # radii of links and of joints
_FRUSTUM_M = 0.15  # length of the lines that show what a camera sees
_VIEWPOINT_M = (1.7, 1.0, 0.35)  # away from the middle of the bases, above it, and where it is looked at above it
_COLOURS = ("#b5541c", "#1f6fb2", "#6a4fb3", "#0f7b6c")  # those of the report
_BODY_COLOUR = "#111827"


class ArmsView:
    """Arms, cameras and targets of a cell; drawn where the cell says roughly where they are.

    Attributes:
        sketch: What is known of the cell; None if that is too little.
    """

    def __init__(self, ui: Any, cell: Cell) -> None:
        self.sketch: Sketch | None = None
        with suppress(BasecalError):
            self.sketch = sketch_cell(cell)
        self._shown: dict[str, RobotState] = {}
        self._rods: dict[str, list[Any]] = {}
        self._things: dict[str, Any] = {}
        if self.sketch is None:
            return
        with ui.scene(width=_SIZE_PX, height=_SIZE_PX, grid=(4, 20)) as scene:
            for number, robot in enumerate(cell.robots):
                self._rods[robot] = _arm(scene, self.sketch, robot, _COLOURS[number % len(_COLOURS)])
            # Lines, (k, 2, 3) [m], each in the frame of its camera or target.
            lenses = {name: camera.intrinsics for name, camera in cell.cameras.items()}
            drawn = {name: frustum(None if lens is None else lens.camera, _FRUSTUM_M) for name, lens in lenses.items()}
            drawn |= {name: outline(target.target) for name, target in cell.targets.items()}
            for name, lines in drawn.items():
                with scene.group() as self._things[name]:
                    for start, end in lines:
                        scene.line(start.tolist(), end.tolist()).material(_BODY_COLOUR)
                self._things[name].visible(False)
        x, y, z = np.mean([self.sketch.world_from_base(robot).translation for robot in cell.robots], axis=0).tolist()
        away, above, look = _VIEWPOINT_M
        scene.move_camera(x, y - away, z + above, x, y, z + look, duration=0)

    def renew(self, states: Mapping[str, RobotState]) -> None:
        """Put what has moved where it now is."""
        moved = {robot for robot, state in states.items() if self._shown.get(robot) is not state}
        if self.sketch is None or not moved:
            return
        self._shown = dict(states)
        for robot in moved & set(self._rods):
            for rod, world_from_rod in zip(self._rods[robot], links(self.sketch, robot, states[robot]), strict=False):
                _set_pose(rod, world_from_rod)
        for name, thing in self._things.items():
            on = (self.sketch.cell.cameras.get(name) or self.sketch.cell.targets[name]).on
            if on == WORLD or on in moved:
                _set_pose(thing, self.sketch.body_pose(name, states))
                thing.visible(True)


def links(sketch: Sketch, robot: str, state: RobotState) -> list[SE3]:
    """Where the middles of links are in the world, each along its y; none of an arm whose joints are not known."""
    found = []
    for start, end in _ends(sketch, robot, state):
        along = end - start
        length = float(np.linalg.norm(along))
        y = along / length if length > 0 else np.array([0.0, 1.0, 0.0])
        x = np.cross(y, np.eye(3)[int(np.argmin(np.abs(y)))])
        x /= np.linalg.norm(x)
        found.append(SE3(np.stack([x, y, np.cross(x, y)], axis=1), (start + end) / 2))
    return found


def lengths(sketch: Sketch, robot: str) -> list[float]:
    """Of the links of an arm [m]; none of a robot without a chain."""
    chain = sketch.cell.robots[robot].chain
    if chain is None:
        return []
    ends = _ends(sketch, robot, RobotState(joints_rad=np.zeros(chain.n)))
    return [float(np.linalg.norm(end - start)) for start, end in ends]


def _ends(sketch: Sketch, robot: str, state: RobotState) -> list[tuple[Array, Array]]:
    base, chain = sketch.world_from_base(robot), sketch.cell.robots[robot].chain
    if chain is None or state.joints_rad is None:
        return []
    frames = base @ chain.joint_frames(state.joints_rad)
    places = [base.translation, *frames.translation, (frames[-1] @ chain.tip).translation]
    return list(pairwise(places))


def _arm(scene: Any, sketch: Sketch, robot: str, colour: str) -> list[Any]:
    """The base of an arm, and a rod with a ball at its end for each of its links, not seen before they are put."""
    x, y, z = sketch.world_from_base(robot).translation.tolist()
    scene.sphere(1.5 * _JOINT_M).material(colour).move(x, y, z)
    rods = []
    for length in lengths(sketch, robot):
        with scene.group() as rod:
            scene.cylinder(_ROD_M, _ROD_M, max(length, 1e-3)).material(colour)
            scene.sphere(_JOINT_M).material(colour).move(0.0, 0.5 * length, 0.0)
        rods.append(rod.visible(False))
    return rods


def _set_pose(body: Any, world_from_thing: SE3) -> None:
    x, y, z = world_from_thing.translation.tolist()
    body.move(x, y, z).rotate_R(world_from_thing.rotation.tolist())
    body.visible(True)
