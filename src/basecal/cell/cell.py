"""The cell: robots, cameras and targets, and prior knowledge of the transforms between them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar, Literal, TypeVar

import numpy as np
from pydantic import ConfigDict, Field, Strict, model_validator

from basecal.cell.target import Target
from basecal.errors import FrameNotFound, InputError, list_names, spelling_hint
from basecal.fields.file_forms import Seconds
from basecal.fields.parameters import Parameters
from basecal.fields.values import Sigma
from basecal.geometry import SE3, Array, Camera
from basecal.geometry.lenses.registry import model_lenses
from basecal.kinematics import SerialChain

Status = Literal["fixed", "prior", "free"]
SensorKind = Literal["camera", "tracker", "tip", "clamp"]
Contact = Literal["plane", "edge", "clamp", "hinge"]
_Timed = TypeVar("_Timed", "Clock", "RollingShutter")
WORLD = "world"
_MOST_JITTER_S = 1.0  # of a clock; with more jitter, images of a moving arm carry no information
_LONGEST_LINE_S = 1e-3  # per row: an image of 1000 rows then takes 1 s. Negative if the bottom row is read first.


def grip_name(clamp: str) -> str:
    """Name of the part's end at the second robot of a clamp."""
    return f"{clamp}_grip"


@dataclass(frozen=True, eq=False)
class Unknown:
    """A rigid transform and the prior knowledge of it.

    Attributes:
        status: `fixed` (exactly `mean`), `prior` (`mean` with `sigma`) or `free`.
        mean: The fixed value, the prior's mean, or the initial guess of a free transform; None if there is none.
        sigma: (6,) [m, rad] in the right tangent of `mean`; with `prior` only.
    """

    status: Status = "free"
    mean: SE3 | None = None
    sigma: Array | None = None


_STRICT_CONFIG = ConfigDict(extra="forbid", allow_inf_nan=False, defer_build=True)


def _check_sigma(timing: _Timed) -> _Timed:
    if (timing.status == "prior") != (timing.sigma_s is not None):
        requirement = "takes sigma_s" if timing.status == "prior" else "takes no sigma_s"
        raise ValueError(f"status {timing.status} {requirement}")
    return timing


@dataclass(frozen=True)
class Clock:
    """Prior knowledge of a device's clock.

    Attributes:
        status: `fixed` (exactly `offset_s`), `prior` (`offset_s` with `sigma_s`) or `free` (`offset_s` is a guess).
        offset_s: Offset to add to the device's stamps to convert them to the reference clock [s].
        sigma_s: Sigma of the prior [s]; with `prior` only.
        jitter_s: Sigma of the independent error of each stamp [s]; None if it is to be estimated. Cameras only.
    """

    __pydantic_config__: ClassVar = _STRICT_CONFIG

    status: Status = "fixed"
    offset_s: Seconds = 0.0
    sigma_s: Sigma | None = None
    jitter_s: Annotated[float, Strict(), Field(ge=0, le=_MOST_JITTER_S)] | None = None

    _check_prior_sigma = model_validator(mode="after")(_check_sigma)


@dataclass(frozen=True)
class RollingShutter:
    """Prior knowledge of the time between successive rows of a camera's images.

    Attributes:
        status: `fixed` (exactly `line_time_s`), `prior` (`line_time_s` with `sigma_s`) or `free` (a guess).
        line_time_s: Time per row [s]: row v is exposed v * line_time_s after the stamp.
        sigma_s: Sigma of the prior [s]; with `prior` only.
    """

    __pydantic_config__: ClassVar = _STRICT_CONFIG

    status: Status = "fixed"
    line_time_s: Annotated[float, Strict(), Field(ge=-_LONGEST_LINE_S, le=_LONGEST_LINE_S)] = 0.0
    sigma_s: Sigma | None = None

    _check_prior_sigma = model_validator(mode="after")(_check_sigma)

    @model_validator(mode="before")
    @classmethod
    def _check_line_time(cls, data: Any) -> Any:
        status = data.get("status", "fixed") if isinstance(data, dict) else "free"
        if status != "free" and "line_time_s" not in data:
            raise ValueError(f"status {status} takes line_time_s, the time from a row to the next in seconds")
        return data


@dataclass(frozen=True, eq=False)
class Driver:
    """The driver that communicates with a robot or a camera.

    Attributes:
        kind: The driver's name.
        options: The driver's options as plain data; the driver validates them when it is opened.
    """

    kind: str
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot arm.

    Attributes:
        name: The robot's name in the cell.
        noise: (6,) [m, rad] sigmas of the recorded pose in flange axes, drawn once per stop; None if not stated.
        chain: The robot's kinematics, if joints are recorded.
        parameters: Prior knowledge of the kinematic parameters, by kind; kinds that are missing are fixed.
        urdf: Path of the URDF relative to the cell; None if poses are recorded.
        base_link: Name of the chain's root in the URDF.
        flange_link: Name of the chain's tip in the URDF.
        frames: Names of `base` and `flange` in other programs, for export.
        controller: `format` of the poses, and the controller's `base` and `tool` frames in which they were recorded.
        clock: Clock of the pose stamps; None if not stated.
        driver: Driver of the robot during recording; None if it has none.
        reach_m: Largest distance of the flange from the base [m]; None if not stated.
        is_total_noise: Whether `noise` covers the total pose error; if False, it covers the repeatability.
    """

    name: str
    noise: Array | None = None
    chain: SerialChain | None = None
    parameters: Mapping[str, Parameters] = field(default_factory=dict)
    urdf: str | None = None
    base_link: str | None = None
    flange_link: str | None = None
    frames: Mapping[str, str] = field(default_factory=dict)
    controller: Mapping[str, str] = field(default_factory=dict)
    clock: Clock | None = None
    driver: Driver | None = None
    reach_m: float | None = None
    is_total_noise: bool = False


@dataclass(frozen=True, eq=False)
class Intrinsics:
    """Prior knowledge of a lens.

    Attributes:
        status: `fixed`, `prior` or `free`.
        camera: The fixed lens, the prior's mean or the initial guess; None if free and not stated.
        sigma: (4 + terms,) sigmas of fx, fy, cx, cy [px] and the distortion; with `prior` only.
        distortion_terms: Number of distortion coefficients to estimate if `camera` is None; the model's usual
            number if None.
        exact: Whether a fixed lens has no error; if False, it has the error of a usual calibration.
    """

    status: Status = "fixed"
    camera: Camera | None = None
    sigma: Array | None = None
    distortion_terms: int | None = None
    exact: bool = False


@dataclass(frozen=True, eq=False)
class CellCamera:
    """A camera in the cell.

    Attributes:
        name: The camera's name in the cell.
        on: The robot whose flange carries the camera, or `world`.
        mount: `<robot>_flange_from_<camera>`, or `<reference>_base_from_<camera>`.
        model: Name of the lens model.
        size_px: Width and height of the images; None if the camera measures only poses or 3-D points.
        intrinsics: Prior knowledge of the lens; None if the camera measures only poses or 3-D points.
        clock: Clock of the image stamps; None if not stated.
        driver: Driver of the camera during recording; None if it has none.
        rolling_shutter: Prior knowledge of the line time; None for a global shutter.
        kind: A `tracker` measures 3-D points in all directions; a `tip` touches at its origin; a `clamp` holds a part.
        frame: Name of the optical frame in other programs; None if not stated.
    """

    name: str
    on: str
    mount: Unknown = Unknown()
    model: str = "pinhole"
    size_px: tuple[int, int] | None = None
    intrinsics: Intrinsics | None = None
    clock: Clock | None = None
    driver: Driver | None = None
    rolling_shutter: RollingShutter | None = None
    kind: SensorKind = "camera"
    frame: str | None = None

    @property
    def touches(self) -> bool:
        """Whether this sensor is the tip of a tool or a clamp."""
        return self.kind in ("tip", "clamp")

    @property
    def distortion_terms(self) -> int:
        """Number of distortion terms of the lens, known or to be estimated; 0 if the camera has no lens."""
        if self.intrinsics is None:
            return 0
        if self.intrinsics.camera is not None:
            return len(self.intrinsics.camera.distortion)
        terms = self.intrinsics.distortion_terms
        return model_lenses(self.model)[0].USUAL_TERMS if terms is None else terms


@dataclass(frozen=True, eq=False)
class CellTarget:
    """A target in the cell.

    Attributes:
        name: The target's name in the cell.
        on: The robot or plate that carries the target, or `world`.
        mount: `<robot>_flange_from_<target>`, or `<reference>_base_from_<target>`.
        target: The target's shape; None if it is seen only as poses.
        size_sigma: Relative sigma of the size; None if not stated. It is 0 if shape and size are exact, and infinite
            if poses are known only up to scale.
        contact: Geometry that a tip or a clamp touches, if not a point: a plane z = 0, an edge or a hinge along z.
    """

    name: str
    on: str
    mount: Unknown = Unknown()
    target: Target | None = None
    size_sigma: float | None = None
    contact: Contact | None = None

    @property
    def has_free_scale(self) -> bool:
        """Whether the target's poses are known only up to scale."""
        return self.size_sigma == math.inf

    @property
    def is_touched(self) -> bool:
        """Whether the target is touched: a mark, a tip, or a part in a clamp."""
        is_point = self.target is not None and self.target.kind in ("mark", "tip")
        return is_point or self.contact is not None


@dataclass(frozen=True, eq=False)
class KeepOut:
    """A box that robots must not enter.

    Attributes:
        name: The box's name.
        world_from_box: Pose of the box's centre, axes along its sides.
        size_m: (3,) side lengths [m].
    """

    name: str
    world_from_box: SE3
    size_m: Array

    def distance(self, points: Array) -> Array:
        """Distances of points (..., 3) [m] in the world from the box, (...) [m]; 0 inside."""
        beyond = np.abs(self.world_from_box.inverse() @ points) - 0.5 * self.size_m
        return np.asarray(np.linalg.norm(np.maximum(beyond, 0.0), axis=-1))


@dataclass(frozen=True, eq=False)
class Cell:
    """A cell: robots, cameras, targets, and prior knowledge of their transforms.

    Attributes:
        reference: The robot whose base is `world`.
        robots: Robots by name, including the reference.
        bases: `<reference>_base_from_<robot>_base` of every other robot, by the robot's name.
        cameras: Cameras by name.
        targets: Targets by name.
        pixel_px: Sigma of a pixel coordinate if an observation has no sigma; None if it is to be estimated.
        correlated_px: Sigma per coordinate of an error that all points of a view share; None if there is none.
        keep_out: Boxes that robots must not enter, by name.
        sees_scene: Whether cameras observe the static scene instead of a target.
        plates: `<reference>_base_from_<plate>` of rigid plates that carry marks, by name.
    """

    reference: str
    robots: Mapping[str, Robot]
    bases: Mapping[str, Unknown] = field(default_factory=dict)
    cameras: Mapping[str, CellCamera] = field(default_factory=dict)
    targets: Mapping[str, CellTarget] = field(default_factory=dict)
    pixel_px: float | None = None
    correlated_px: float | None = None
    keep_out: Mapping[str, KeepOut] = field(default_factory=dict)
    sees_scene: bool = False
    plates: Mapping[str, Unknown] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that names are consistent.

        Raises:
            InputError: if a key differs from the item's own name, or a name refers to an unknown robot.
        """
        given: dict[str, Robot | CellCamera | CellTarget] = {**self.robots, **self.cameras, **self.targets}
        for name, item in given.items():
            if item.name != name:
                raise InputError(f"{item.name!r} is listed under the name {name!r}: expected the same name")
        carriers = {item.name: item.on for item in self._mounted_items if item.on != WORLD}
        for entry, robot in {"reference": self.reference, **{name: name for name in self.bases}, **carriers}.items():
            if robot not in self.robots and robot not in self.plates:
                robots = list_names(list(self.robots))
                raise InputError(f"{entry}: no robot {robot!r}{spelling_hint(robot, self.robots)}; there are: {robots}")

    def __repr__(self) -> str:
        """Return a one-line summary."""
        carried = [f"{item.name} on {item.on}" for item in self._mounted_items]
        return f"<cell of {list_names(list(self.robots))}: {list_names(carried)}>"

    @property
    def _mounted_items(self) -> list[CellCamera | CellTarget]:
        return [*self.cameras.values(), *self.targets.values()]

    def plate_name(self, plate: str) -> str:
        """Name of the transform from a plate to the reference's base, `a_from_b`."""
        return f"{self.reference}_base_from_{plate}"

    def base_name(self, robot: str) -> str:
        """Name of the transform from the base of `robot` to the reference's base, `a_from_b`."""
        return f"{self.reference}_base_from_{robot}_base"

    def mount_name(self, name: str) -> str:
        """Name of the mount of a camera or target, `a_from_b`.

        Raises:
            FrameNotFound: if the cell has no such camera or target.
        """
        item = self.cameras.get(name) or self.targets.get(name)
        if item is None:
            raise FrameNotFound(name, [*self.cameras, *self.targets])
        carrier = f"{self.reference}_base" if item.on == WORLD else f"{item.on}_flange"
        if item.on in self.plates:
            carrier = item.on
        return f"{carrier}_from_{name}"

    @property
    def transforms(self) -> dict[str, Unknown]:
        """Prior knowledge of every transform by name: bases, plates, then mounts of cameras and of targets."""
        others = [robot for robot in self.robots if robot != self.reference]
        named = {self.base_name(robot): self.bases.get(robot, Unknown()) for robot in others}
        named |= {self.plate_name(plate): mount for plate, mount in self.plates.items()}
        for item in self._mounted_items:
            named[self.mount_name(item.name)] = item.mount
        return named

    def with_transform(self, name: str, unknown: Unknown) -> Cell:
        """Return a copy of the cell with new prior knowledge of one of its `transforms`."""
        bases = {r: unknown for r in self.robots if r != self.reference and self.base_name(r) == name}
        cameras = {k: replace(c, mount=unknown) if self.mount_name(k) == name else c for k, c in self.cameras.items()}
        targets = {k: replace(c, mount=unknown) if self.mount_name(k) == name else c for k, c in self.targets.items()}
        plates = {k: unknown if self.plate_name(k) == name else known for k, known in self.plates.items()}
        return replace(self, bases={**self.bases, **bases}, cameras=cameras, targets=targets, plates=plates)

    @property
    def requested_transforms(self) -> list[str]:
        """Names of the requested transforms: the bases that are not fixed, else all transforms that are not fixed."""
        unknown_names = [name for name, unknown in self.transforms.items() if unknown.status != "fixed"]
        bases = {self.base_name(robot) for robot in self.robots}
        return [name for name in unknown_names if name in bases] or unknown_names
