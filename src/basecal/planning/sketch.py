"""Approximate model of a cell before calibration: accurate enough to keep a target in view."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from basecal.cell import WORLD, Cell, CellCamera, CellTarget, RobotState, Sample, Target
from basecal.errors import InputError
from basecal.geometry import SE3, Array, Camera

View = tuple[str, str]
"""Names of a camera and a target."""

NEAREST_M = 0.2
"""Assumed smallest distance from a camera to a target before any was seen: usual lenses are not sharp below it."""


def target_points(target: Target | None) -> Array:
    """Points of a target in its frame, (n, 3) [m]; the origin if the shape is unknown."""
    return np.zeros((1, 3)) if target is None else target.points


@dataclass(frozen=True, eq=False)
class Sketch:
    """A cell with a value for every transform: known, stated as a prior, or guessed.

    Attributes:
        cell: The cell.
        transforms: Values of the transforms, by name.
        view: Names of the camera and the target.
        nearest_m: Smallest depth of a target's points in the camera that a plan may use [m].
    """

    cell: Cell
    transforms: Mapping[str, SE3]
    view: View
    nearest_m: float = NEAREST_M

    @property
    def camera(self) -> CellCamera:
        """The camera of the view."""
        return self.cell.cameras[self.view[0]]

    @property
    def target(self) -> CellTarget:
        """The target of the view."""
        return self.cell.targets[self.view[1]]

    @property
    def lens(self) -> Camera:
        """The camera's lens.

        Raises:
            InputError: if the cell states no lens of the camera.
        """
        lens = None if self.camera.intrinsics is None else self.camera.intrinsics.camera
        if lens is None:
            raise InputError(f"{self.camera.name}: a plan needs a lens; state intrinsics, as a guess if need be")
        return lens

    @property
    def target_points(self) -> Array:
        """Points of the target in its frame, (n, 3) [m]; the origin if the shape is unknown."""
        return target_points(self.target.target)

    @property
    def movers(self) -> tuple[str, ...]:
        """Robots that carry the camera or the target, the camera's first."""
        return tuple(
            dict.fromkeys(carrier for carrier in (self.camera.on, self.target.on) if carrier in self.cell.robots)
        )

    def base_from_flange(self, robot: str, state: RobotState) -> SE3:
        """Pose of a robot's flange in its base.

        Raises:
            InputError: if the state has joints and the robot has no kinematic chain.
        """
        if state.base_from_flange is not None:
            return state.base_from_flange
        chain = self.cell.robots[robot].chain
        if chain is None or state.joints_rad is None:
            raise InputError(f"{robot}: joints need urdf, base_link and flange_link in cell.yaml")
        return chain.forward(state.joints_rad)

    def world_from_base(self, robot: str) -> SE3:
        """Pose of a robot's base in the world."""
        return SE3.identity() if robot == self.cell.reference else self.transforms[self.cell.base_name(robot)]

    def body_pose(self, name: str, states: Mapping[str, RobotState]) -> SE3:
        """Pose of a camera or target in the world, with the robots at the given states."""
        mount = self.transforms[self.cell.mount_name(name)]
        carrier = (self.cell.cameras.get(name) or self.cell.targets[name]).on
        if carrier in self.cell.plates:
            return self.transforms[self.cell.plate_name(carrier)] @ mount
        return (
            mount
            if carrier == WORLD
            else self.world_from_base(carrier) @ self.base_from_flange(carrier, states[carrier]) @ mount
        )

    def camera_from_target(self, sample: Sample) -> SE3:
        """Predicted pose of the target in the camera."""
        camera, target = self.view
        return self.body_pose(camera, sample.robots).inverse() @ self.body_pose(target, sample.robots)


@dataclass(frozen=True, eq=False)
class SceneSketch(Sketch):
    """A cell whose cameras see only the scene: its transforms are unknown, and nothing can be planned."""

    @property
    def movers(self) -> tuple[str, ...]:
        """Robots that carry a camera."""
        return tuple(dict.fromkeys(each.on for each in self.cell.cameras.values() if each.on != WORLD))


def hand_guided_sketch(cell: Cell) -> Sketch:
    """Sketch of a cell whose arms a person leads; a cell without targets gives a `SceneSketch`.

    Raises:
        InputError: under the conditions of `sketch_cell`, or if the cell has no camera.
    """
    if not cell.sees_scene:
        return sketch_cell(cell)
    if not cell.cameras:
        raise InputError("the cell has no camera: add one to cell.yaml")
    return SceneSketch(cell, {}, (next(iter(cell.cameras)), ""))


def possible_views(cell: Cell) -> list[View]:
    """Pairs of a camera and a target that it may see: all that are not mounted on the same body."""
    return [(c.name, t.name) for c in cell.cameras.values() for t in cell.targets.values() if c.on != t.on]


def sketch_cell(cell: Cell) -> Sketch:
    """Sketch of the first camera of a cell and the first target that is not mounted on the same body.

    Raises:
        InputError: if there is no such pair, or a transform has no value; the message names it.
    """
    views = possible_views(cell)
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
