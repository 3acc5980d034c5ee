"""Parts that two robots hold at once, as `cell.yaml` states them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field
from pydantic import field_validator as checks

from basecal.cell.cell import Cell, CellCamera, CellTarget, Contact, Unknown, grip_name
from basecal.fields.values import Entry, empty
from basecal.geometry import SE3, read_only

_ONLY_NAME = "part"  # of a part that is stated without one
_CONTACTS: Mapping[str, Contact] = {"fixed": "clamp", "free": "hinge"}

_REACH_M = 0.2  # [m] of a part from the flange that holds it, one sigma
# A rigid part has no frame of its own: it has the axes of the flange, and is where its grip errs independently.
_RIGID = Unknown("prior", SE3.identity(), read_only([_REACH_M] * 3 + [np.inf] * 3))


class ClampEntry(Entry):
    """A part that two robots hold: rigidly, or so that it turns about an axis."""

    robots: Annotated[list[str], Field(min_length=2, max_length=2)]
    axis: Literal["fixed", "free"] = "fixed"

    @checks("robots")
    @classmethod
    def _two(cls, value: list[str]) -> list[str]:
        if value[0] == value[1]:
            raise ValueError("expected two robots that hold the part, got one twice")
        return value


def named_clamps(value: Any) -> Any:
    """Parts by name, also of a single one that is stated without a name."""
    return {_ONLY_NAME: value} if isinstance(value, dict) and "robots" in value else empty(value)


def clamp_names(data: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Parts and what is written of them in the data of a cell, whatever else is wrong with it."""
    clamps = named_clamps(data.get("clamp"))
    yield from clamps.items() if isinstance(clamps, dict) else ()


def with_clamps(cell: dict[str, Any], clamps: Mapping[str, ClampEntry]) -> None:
    """Add parts to those of a cell: what the first robot holds meets what the second holds.

    Args:
        cell: Arguments of `Cell`.
        clamps: By name.
    """
    for name, clamp in clamps.items():
        one, other = clamp.robots
        held = _RIGID if clamp.axis == "fixed" else Unknown()
        cell["cameras"][name] = CellCamera(name, one, held, kind="clamp")
        grip = CellTarget(grip_name(name), other, size_sigma=0.0, contact=_CONTACTS[clamp.axis])
        cell["targets"][grip.name] = grip


def clamps_dict(cell: Cell) -> dict[str, Any]:
    """The section `clamp` that is read back to the same cell."""
    clamps = {}
    for name, camera in cell.cameras.items():
        if camera.kind == "clamp":
            grip = cell.targets[grip_name(name)]
            axis = next(axis for axis, contact in _CONTACTS.items() if contact == grip.contact)
            clamps[name] = {"robots": [camera.on, grip.on], "axis": axis}
    return {"clamp": clamps}
