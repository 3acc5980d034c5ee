"""Pydantic types of numbers, sigmas and poses in `cell.yaml`.

Limits on size keep later arithmetic finite: no length in a cell exceeds 1e6 m, and no sigma is below 1e-12.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic import field_validator as checks

from basecal.errors import spelling_hint
from basecal.fields.problems import SHORT_LENGTH, shorten
from basecal.geometry import SE3

LARGEST_VALUE = 1e6
"""Largest number [m, px, rad]: a thousand kilometres; sums of its square over samples do not overflow."""

SMALLEST_LENGTH_M, LARGEST_LENGTH_M = 1e-6, 1e3
"""Limits of printed or measured lengths, such as a square: from a microscope's resolution to a kilometre."""

SMALLEST_SIGMA = 1e-12
"""Smallest sigma [m, px, rad]: below that of any instrument; the inverse of its square does not overflow."""

_IDENTITY_TOLERANCE = 1e-9  # of a rotation matrix from the identity: larger than the rounding of written digits
_FULL_TURN_RAD = 2 * np.pi * 1.001  # [rad] with a margin for the rounding of written digits
_ROTATIONS = ("q_xyzw", "rotvec_rad", "rpy_deg")


def _sigma_list_validator(count: int | None) -> Callable[[Any], list[float]]:
    """Create a validator for one positive number, or a list of `count` of them; of any length if `count` is None."""

    def check(value: Any) -> list[float]:
        """Return the numbers as a list."""
        is_single = not isinstance(value, list)
        values = [value] * (count or 1) if is_single else value
        if count not in (None, len(values)) or not values or not all(map(_is_sigma, values)):
            many = "a list of them" if count is None else f"{count} of them"
            raise ValueError(f"expected one positive number or {many}, got {shorten(value) if is_single else value}")
        return [float(v) for v in values]

    return check


def _check_sigma(value: Any) -> Any:
    if not _is_sigma(value):
        raise ValueError(f"expected a positive number, got {shorten(value)}")
    return value


def _is_sigma(value: Any) -> bool:
    return isinstance(value, int | float) and value is not True and SMALLEST_SIGMA <= value <= LARGEST_VALUE


def known_name_validator(kind: str, names: tuple[str, ...]) -> AfterValidator:
    """Create a validator for known names."""

    def check(name: str) -> str:
        """Return the name if it is known."""
        if name not in names:
            hint = spelling_hint(name[:SHORT_LENGTH], names)
            raise ValueError(f"no {kind} {name[:SHORT_LENGTH]!r}{hint}; there are: {', '.join(names)}")
        return name

    return AfterValidator(check)


def empty_if_missing(value: Any) -> Any:
    """Convert a missing value after a colon to an empty entry."""
    return {} if value is None else value


Number = Annotated[float, Field(ge=-LARGEST_VALUE, le=LARGEST_VALUE)]
Length = Annotated[float, Field(ge=SMALLEST_LENGTH_M, le=LARGEST_LENGTH_M)]
Pixels = Annotated[float, Field(gt=0, le=LARGEST_VALUE)]
Vector = Annotated[list[Number], Field(min_length=3, max_length=3)]
Sigma = Annotated[float, BeforeValidator(_check_sigma)]
Sigma2 = Annotated[list[float], BeforeValidator(_sigma_list_validator(2))]
Sigma3 = Annotated[list[float], BeforeValidator(_sigma_list_validator(3))]
Sigmas = Annotated[list[float], BeforeValidator(_sigma_list_validator(None))]
Status = Literal["fixed", "prior", "free"]
_Row = Annotated[list[Number], Field(min_length=4, max_length=4)]


_PAIR = Field(min_length=2, max_length=2)
MOST_POINTS = 1000
"""Largest number of squares along a side, or of tags of a target: more than any detector finds."""

_LARGEST_SIDE_PX = 100_000  # of an image: ten times the size of sensors
# Two whole numbers: the sides of an image [px], squares or corners along both sides of a board.
ImageSize = Annotated[list[Annotated[int, Field(ge=1, le=_LARGEST_SIDE_PX)]], _PAIR]
Squares = Annotated[list[Annotated[int, Field(ge=3, le=MOST_POINTS)]], _PAIR]
Corners = Annotated[list[Annotated[int, Field(ge=2, le=MOST_POINTS)]], _PAIR]


class Entry(BaseModel):
    """Base class of entries: strict, immutable mappings of known fields."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, frozen=True, defer_build=True)


class PoseEntry(Entry):
    """A pose in one of the notations of `cell.yaml`."""

    t_m: Vector | None = None
    q_xyzw: _Row | None = None
    rotvec_rad: Vector | None = None
    rpy_deg: Vector | None = None
    matrix: Annotated[list[_Row], Field(min_length=4, max_length=4)] | None = None

    @checks("q_xyzw")
    @classmethod
    def _check_quaternion(cls, value: list[float] | None) -> list[float] | None:
        if value is not None:
            SE3.from_quaternion(value, np.zeros(3))
        return value

    @checks("rotvec_rad")
    @classmethod
    def _check_rotvec(cls, value: list[float] | None) -> list[float] | None:
        if value is not None and (length := float(np.linalg.norm(value))) > _FULL_TURN_RAD:
            expected = f"no rotation vector is longer than a turn, {2 * np.pi:.3g} rad"
            raise ValueError(f"has length {length:.3g}, {expected}: it looks like degrees, write radians")
        return value

    @checks("matrix")
    @classmethod
    def _check_matrix(cls, value: list[list[float]] | None) -> list[list[float]] | None:
        if value is not None:
            SE3.from_matrix(value)
        return value


class UnknownEntry(PoseEntry):
    """A transform with its status: fixed, with a prior, or free."""

    status: Status = "free"
    sigma_t_m: Sigma3 | None = None
    sigma_r_rad: Sigma3 | None = None
    guess: PoseEntry | None = None


def given_fields(pose: PoseEntry) -> list[str]:
    """Names of the pose's fields that are set."""
    return [name for name in PoseEntry.model_fields if getattr(pose, name) is not None]


def pose_se3(pose: PoseEntry) -> SE3:
    """Convert a validated pose to a transform; a position alone gives the identity rotation."""
    if pose.matrix is not None:
        return SE3.from_matrix(pose.matrix)
    if pose.q_xyzw is not None:
        return SE3.from_quaternion(pose.q_xyzw, pose.t_m or ())
    if pose.rpy_deg is not None:
        return SE3.from_rpy(np.deg2rad(pose.rpy_deg), pose.t_m or ())
    return SE3.from_rotvec(pose.rotvec_rad or np.zeros(3), pose.t_m or ())


def check_full_pose(pose: PoseEntry) -> PoseEntry:
    """Check that a pose has a position and exactly one rotation, and return it.

    Raises:
        ValueError: if it does not.
    """
    names = given_fields(pose)
    rotations = [name for name in names if name in _ROTATIONS]
    if "matrix" in names and len(names) > 1:
        raise ValueError("expected `matrix` alone, without t_m and other rotations")
    if "matrix" not in names and not ("t_m" in names and len(rotations) == 1):
        got = ", ".join(names) or "neither"
        raise ValueError(f"expected t_m and exactly one of {', '.join(_ROTATIONS)}, or a 4x4 matrix; got {got}")
    return pose


def _check_point_pose(pose: PoseEntry) -> PoseEntry:
    names = given_fields(pose)
    if not names:
        raise ValueError("expected t_m, the position of the point")
    if names != ["t_m"]:
        check_full_pose(pose)
        if not np.allclose(pose_se3(pose).rotation, np.eye(3), atol=_IDENTITY_TOLERANCE):
            raise ValueError("a single point has no rotation; give t_m alone")
    return pose


def _check_status(entry: UnknownEntry, pose_check: Callable[[PoseEntry], PoseEntry], sigmas: set[str]) -> None:
    stated = {name for name in ("sigma_t_m", "sigma_r_rad") if getattr(entry, name) is not None}
    expected = sigmas if entry.status == "prior" else set()
    if stated - expected:
        why = "of a single point has no rotation" if entry.status == "prior" else f"with status {entry.status} has none"
        raise ValueError(f"a transform {why}: remove {', '.join(sorted(stated - expected))}")
    if expected - stated:
        raise ValueError(f"status prior needs {', '.join(sorted(expected - stated))}")
    if entry.status == "free":
        if given_fields(entry):
            raise ValueError("status free takes no pose; write it as `guess: {...}`, or set status fixed or prior")
        if entry.guess is not None:
            pose_check(entry.guess)
        return
    if entry.guess is not None:
        raise ValueError(f"status {entry.status} takes no guess; write the pose beside the status")
    pose_check(entry)


def _check_rigid_unknown(entry: UnknownEntry) -> UnknownEntry:
    _check_status(entry, check_full_pose, {"sigma_t_m", "sigma_r_rad"})
    return entry


def _check_point_unknown(entry: UnknownEntry) -> UnknownEntry:
    _check_status(entry, _check_point_pose, {"sigma_t_m"})
    return entry


Mount = Annotated[UnknownEntry, AfterValidator(_check_rigid_unknown), BeforeValidator(empty_if_missing)]
PointMount = Annotated[UnknownEntry, AfterValidator(_check_point_unknown), BeforeValidator(empty_if_missing)]


def _check_path(text: str) -> str:
    if "\0" in text:
        raise ValueError(f"{text!r} is not a path: it holds a null character")
    return text


PathText = Annotated[str, Field(min_length=1), AfterValidator(_check_path)]
"""A path without null characters."""
