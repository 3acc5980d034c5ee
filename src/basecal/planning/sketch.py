"""A cell as far as it is known before anything was seen: good enough to keep a target in view."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from basecal.cell import WORLD, Cell, CellCamera, CellTarget, RobotState, Sample, Target
from basecal.errors import InputError
from basecal.geometry import SE3, Array, Camera

View = tuple[str, str]
"""A camera and a target."""

NEAREST_M = 0.2
"""From a camera to a target, as far as is known before any was seen; assumed: nearer, usual lenses are not sharp."""


def target_points(target: Target | None) -> Array:
    """Points of a target in its frame, (n, 3) [m]; its origin if its shape is not known."""
    return np.zeros((1, 3)) if target is None else target.points


@dataclass(frozen=True, eq=False)
class Sketch:
    """A cell with a value for every transform: known, stated as a prior, or guessed.

    Attributes:
        cell: The cell.
        transforms: By name.
        view: The camera and the target that are looked at.
        nearest_m: How near a camera the points of a target may be planned.
    """

    cell: Cell
    transforms: Mapping[str, SE3]
    view: View
    nearest_m: float = NEAREST_M

    @property
    def camera(self) -> CellCamera:
        """The camera that looks."""
        return self.cell.cameras[self.view[0]]

    @property
    def target(self) -> CellTarget:
        """The target that is looked at."""
        return self.cell.targets[self.view[1]]

    @property
    def lens(self) -> Camera:
        """The camera's lens.

        Raises:
            InputError: if the cell has none.
        """
        lens = None if self.camera.intrinsics is None else self.camera.intrinsics.camera
        if lens is None:
            raise InputError(f"{self.camera.name}: a plan needs a lens; state intrinsics, as a guess if need be")
        return lens

    @property
    def target_points(self) -> Array:
        """Points of the target in its frame, (n, 3) [m]; its origin if its shape is not known."""
        return target_points(self.target.target)

    @property
    def movers(self) -> tuple[str, ...]:
        """Robots that carry the camera or the target, the camera's first."""
        return tuple(dict.fromkeys(on for on in (self.camera.on, self.target.on) if on in self.cell.robots))

    def base_from_flange(self, robot: str, state: RobotState) -> SE3:
        """Where a flange is.

        Raises:
            InputError: if joints are given of a robot without a chain.
        """
        if state.base_from_flange is not None:
            return state.base_from_flange
        chain = self.cell.robots[robot].chain
        if chain is None or state.joints_rad is None:
            raise InputError(f"{robot}: joints need urdf, base_link and flange_link in cell.yaml")
        return chain.forward(state.joints_rad)

    def world_from_base(self, robot: str) -> SE3:
        """Where a robot stands."""
        return SE3.identity() if robot == self.cell.reference else self.transforms[self.cell.base_name(robot)]

    def body_pose(self, name: str, states: Mapping[str, RobotState]) -> SE3:
        """Where a camera or target is, with the robots at these states."""
        mount = self.transforms[self.cell.mount_name(name)]
        on = (self.cell.cameras.get(name) or self.cell.targets[name]).on
        if on in self.cell.plates:
            return self.transforms[self.cell.plate_name(on)] @ mount
        return mount if on == WORLD else self.world_from_base(on) @ self.base_from_flange(on, states[on]) @ mount

    def camera_from_target(self, sample: Sample) -> SE3:
        """Predicted pose of the target in the camera."""
        camera, target = self.view
        return self.body_pose(camera, sample.robots).inverse() @ self.body_pose(target, sample.robots)


@dataclass(frozen=True, eq=False)
class SceneSketch(Sketch):
    """A cell whose cameras see the scene alone: nothing of its transforms is known, and nothing can be planned."""

    @property
    def movers(self) -> tuple[str, ...]:
        """Robots that carry a camera."""
        return tuple(dict.fromkeys(each.on for each in self.cell.cameras.values() if each.on != WORLD))


def led_sketch(cell: Cell) -> Sketch:
    """The sketch of a cell whose arms a person leads: also of one that sees the scene alone.

    Raises:
        InputError: as `sketch_cell`; or if there is no camera.
    """
    if not cell.sees_scene:
        return sketch_cell(cell)
    if not cell.cameras:
        raise InputError("the cell has no camera: add one to cell.yaml")
    return SceneSketch(cell, {}, (next(iter(cell.cameras)), ""))


def seen_views(cell: Cell) -> list[View]:
    """Each camera and target that it may see: those that do not hang on the same body."""
    return [(c.name, t.name) for c in cell.cameras.values() for t in cell.targets.values() if c.on != t.on]


def sketch_cell(cell: Cell) -> Sketch:
    """The sketch of a cell: of its first camera, and the first target that does not hang on the same body.

    Raises:
        InputError: if it has none, or a transform without a value; the message names it.
    """
    views = seen_views(cell)
    if not views and cell.sees_scene:
        raise InputError(
            "images of a scene are not planned: lead the arms yourself (`basecal capture CELL --freedrive`). Take 15 "
            "with each arm, five of them of one spot from similar directions. Rotate the flange by 20 deg about two "
            "axes, and do not aim all at one spot"
        )
    if not views:
        raise InputError("the cell has no camera with a target to look at: add one of each to cell.yaml")
    open_names = [name for name, unknown in cell.transforms.items() if unknown.mean is None]
    if open_names:
        raise InputError(
            f"a plan needs to know roughly where things are: in cell.yaml, give {open_names[0]} a value, or with "
            "`status: free` a `guess: {t_m: ..., rpy_deg: ...}` by tape measure and eye"
        )
    means = {name: unknown.mean for name, unknown in cell.transforms.items() if unknown.mean is not None}
    return Sketch(cell, means, views[0])
