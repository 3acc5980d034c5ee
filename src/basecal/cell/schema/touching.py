"""Sections of `cell.yaml` for tool tips, the marks that they touch, and clamps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field
from pydantic import field_validator as checks
from pydantic import model_validator as checks_whole

from basecal.cell.cell import WORLD, Cell, CellCamera, CellTarget, Contact, Unknown, grip_name
from basecal.cell.format.plain import numbers
from basecal.cell.target import Target
from basecal.fields.values import Entry, Mount, PointMount, Sigma, UnknownEntry, Vector, empty_if_missing
from basecal.geometry import SE3, read_only
from basecal.numerics.spectral import principal_axes

_USUAL_SIGMA_M = 2e-5  # [m] per axis, for a drilled or milled plate, or a point measured by another instrument
_LINE_SHARE = 1e-6  # largest deviation of collinear marks from an axis, as a share of the line's length
_Points = dict[str, Vector] | list[Vector]
_DEFAULT_NAME = "part"  # name of a single part without a stated name
_CONTACTS: Mapping[str, Contact] = {"fixed": "clamp", "free": "hinge"}

_PART_DISTANCE_SIGMA_M = 0.2  # [m] sigma of the distance between a part and its flange
# A rigid part has no frame of its own: its axes are the flange's, its origin is where translation and rotation
# errors of the grip are independent.
_RIGID = Unknown("prior", SE3.identity(), read_only([_PART_DISTANCE_SIGMA_M] * 3 + [np.inf] * 3))


class TipEntry(Entry):
    """A tip on a robot's flange."""

    on: str
    offset: PointMount = UnknownEntry()


class MarkEntry(Entry):
    """A mark at an unknown or stated position, or a rigid plate of several marks with its `mount` in the world.

    The `mount` of a plane (z = 0) or an edge (along z) is its pose.
    """

    shape: Literal["point", "plane", "edge"] = "point"
    points_m: _Points | None = None
    sigma_m: Sigma | None = None
    exact: bool = False
    mount: Mount = UnknownEntry()

    @checks("points_m", mode="before")
    @classmethod
    def _check_points(cls, value: Any) -> Any:
        if value in ({}, []):
            raise ValueError("expected at least one point")
        return value

    @checks_whole(mode="after")
    def _check_fields(self) -> MarkEntry:
        if self.points_m is None and (self.sigma_m is not None or self.exact):
            raise ValueError("sigma_m and exact belong to points_m, which is missing")
        if self.exact and self.sigma_m is not None:
            raise ValueError("exact takes no sigma_m: remove one of them")
        if self.shape != "point" and self.points_m is not None:
            raise ValueError("a plane or an edge is stated by its mount: remove points_m")
        if self.shape == "point" and not self.is_plate and self.mount != UnknownEntry():
            raise ValueError("mount is for a plate of several points_m; state a single mark as points_m: [[x, y, z]]")
        if self.is_plate and _is_oblique_line(self.points_m):
            raise ValueError("collinear marks of a plate must lie along an axis of the plate: x, y or z")
        return self

    @property
    def is_plate(self) -> bool:
        """Whether the entry is a plate with an unknown pose."""
        return isinstance(self.points_m, dict) or (self.points_m is not None and len(self.points_m) > 1)

    def positions(self, name: str) -> dict[str, Unknown]:
        """Prior knowledge of each mark's position by name, in the frame of the plate or the world."""
        if self.points_m is None:
            return {name: Unknown()}
        named = self.points_m
        if not isinstance(named, dict):
            named = {f"{name}_{k}" if self.is_plate else name: point for k, point in enumerate(named)}
        return {each: self._position(point) for each, point in named.items()}

    def _position(self, point: list[float]) -> Unknown:
        mean = SE3(np.eye(3), np.array(point))
        if self.exact:
            return Unknown("fixed", mean)
        sigma = _USUAL_SIGMA_M if self.sigma_m is None else self.sigma_m
        return Unknown("prior", mean, read_only([sigma] * 3 + [0.0] * 3, (6,), "sigma"))


def _is_oblique_line(points_m: _Points | None) -> bool:
    """Whether the marks are collinear but not along an axis."""
    points = np.array(list(points_m.values() if isinstance(points_m, dict) else points_m or ()))
    extents = np.sort(np.ptp(points, axis=0))
    return principal_axes(points - points.mean(0)).dimension == 1 and bool(extents[1] > _LINE_SHARE * extents[2])


def point_shape(kind: str) -> Target:
    """Shape of a single point at the target's origin."""
    return Target(kind, np.zeros(1, dtype=np.int64), np.zeros((1, 3)))


def mark_names(data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Pairs (plate, mark) of names in the data of a cell; invalid entries are skipped."""
    marks = data.get("marks")
    for plate, entry in marks.items() if isinstance(marks, dict) else ():
        points = entry.get("points_m") if isinstance(entry, dict) else None
        if isinstance(points, dict):
            yield from ((plate, name) for name in points)


def add_touching(
    cell: dict[str, Any], tips: Mapping[str, TipEntry], marks: Mapping[str, MarkEntry], make_unknown: Any
) -> None:
    """Add tips and marks to a cell: a tip is a camera that observes marks and tips at its own origin.

    Args:
        cell: Arguments of `Cell`, changed in place.
        tips: Tips by name.
        marks: Single marks and plates by name.
        make_unknown: Function from the entry of a transform to its prior knowledge.
    """
    for name, tip in tips.items():
        cell["cameras"][name] = CellCamera(name, tip.on, make_unknown(tip.offset), kind="tip")
        cell["targets"][name] = CellTarget(name, tip.on, make_unknown(tip.offset), point_shape("tip"))
    for name, mark in marks.items():
        on = name if mark.is_plate else WORLD
        if mark.shape != "point":
            mount = make_unknown(mark.mount)
            cell["targets"][name] = CellTarget(name, WORLD, mount, size_sigma=0.0, contact=mark.shape)
            continue
        if mark.is_plate:
            cell["plates"][name] = make_unknown(mark.mount)
        for each, position in mark.positions(name).items():
            cell["targets"][each] = CellTarget(each, on, position, point_shape("mark"))


def touching_dict(cell: Cell, unknown_dict: Any) -> dict[str, Any]:
    """Sections `tips` and `marks` of a cell as plain data; reading them gives the same cell.

    Args:
        cell: The cell.
        unknown_dict: Function from a transform's prior knowledge, and whether it is a point, to plain data.
    """
    tips = {
        c.name: {"on": c.on, "offset": unknown_dict(c.mount, True)} for c in cell.cameras.values() if c.kind == "tip"
    }
    marks: dict[str, Any] = {name: {"mount": unknown_dict(mount, False)} for name, mount in cell.plates.items()}
    for name, target in cell.targets.items():
        if target.target is not None and target.target.kind == "mark":
            marks.setdefault(name if target.on == WORLD else target.on, {}).update(_mark_fields(marks, name, target))
        elif target.contact is not None and target.on == WORLD:
            marks[name] = {"shape": target.contact, "mount": unknown_dict(target.mount, False)}
    return {"tips": tips, "marks": marks}


def _mark_fields(marks: Mapping[str, Any], name: str, target: CellTarget) -> dict[str, Any]:
    """Fields of a mark to add to its entry."""
    known = target.mount
    if known.mean is None:
        return {}
    point = numbers(known.mean.translation)
    stated = {"exact": True} if known.sigma is None else {"sigma_m": float(known.sigma[0])}
    if target.on == WORLD:
        return {"points_m": [point], **stated}
    return {"points_m": {**marks[target.on].get("points_m", {}), name: point}, **stated}


class ClampEntry(Entry):
    """A part held by two robots: rigidly, or free to rotate about an axis."""

    robots: Annotated[list[str], Field(min_length=2, max_length=2)]
    axis: Literal["fixed", "free"] = "fixed"

    @checks("robots")
    @classmethod
    def _check_robots(cls, value: list[str]) -> list[str]:
        if value[0] == value[1]:
            raise ValueError("expected two robots that hold the part, got one twice")
        return value


def named_clamps(value: Any) -> Any:
    """Entries of parts by name; a single part without a name gets the name `part`."""
    return {_DEFAULT_NAME: value} if isinstance(value, dict) and "robots" in value else empty_if_missing(value)


def clamp_names(data: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Names and raw entries of parts in the data of a cell, without validation."""
    clamps = named_clamps(data.get("clamp"))
    yield from clamps.items() if isinstance(clamps, dict) else ()


def add_clamps(cell: dict[str, Any], clamps: Mapping[str, ClampEntry]) -> None:
    """Add clamped parts to a cell: the first robot's end is a camera, the second robot's end its target.

    Args:
        cell: Arguments of `Cell`, changed in place.
        clamps: Entries by name.
    """
    for name, clamp in clamps.items():
        first, second = clamp.robots
        mount = _RIGID if clamp.axis == "fixed" else Unknown()
        cell["cameras"][name] = CellCamera(name, first, mount, kind="clamp")
        grip = CellTarget(grip_name(name), second, size_sigma=0.0, contact=_CONTACTS[clamp.axis])
        cell["targets"][grip.name] = grip


def clamps_dict(cell: Cell) -> dict[str, Any]:
    """Section `clamp` of a cell as plain data; reading it gives the same cell."""
    clamps = {}
    for name, camera in cell.cameras.items():
        if camera.kind == "clamp":
            grip = cell.targets[grip_name(name)]
            axis = next(axis for axis, contact in _CONTACTS.items() if contact == grip.contact)
            clamps[name] = {"robots": [camera.on, grip.on], "axis": axis}
    return {"clamp": clamps}
