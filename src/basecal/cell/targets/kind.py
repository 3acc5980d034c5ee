"""Interface of a kind of target: each module of a kind in this folder defines `KIND`, a `TargetKind`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import model_validator

from basecal.cell.target import Target
from basecal.fields.values import Entry, Mount, Sigma, UnknownEntry
from basecal.geometry import Array

Fields = Mapping[str, Any]
"""Fields of a target's entry in `cell.yaml`, as plain data."""


class TargetEntry(Entry):
    """A target in `cell.yaml` that is seen only as poses; base class of the entries of each kind."""

    on: str
    mount: Mount = UnknownEntry()
    size_sigma: Sigma | None = None
    exact: bool = False
    scale: Literal["free"] | None = None

    @model_validator(mode="after")
    def _check_size(self) -> Self:
        if self.exact and self.size_sigma is not None:
            raise ValueError("exact takes no size_sigma: remove one of them")
        if self.scale and (self.exact or self.size_sigma is not None or type(self) is not TargetEntry):
            raise ValueError("scale is for a target that is seen only as poses: remove kind, exact and size_sigma")
        return self

    def shape(self) -> Target | None:
        """Return the target's shape; None if it is seen only as poses."""
        return None


@dataclass(frozen=True)
class PrintSizes:
    """Sizes of a target to print, from the options of `basecal target`; lengths in metres."""

    columns: int
    rows: int
    square_m: float
    marker_m: float
    dictionary: str
    family: str
    tag: int


class KindDescription(NamedTuple):
    """Row of a kind in the table of docs/data_format.md."""

    fields: str
    ids: str
    origin: str


@dataclass(frozen=True)
class TargetKind:
    """A kind of target.

    Attributes:
        entries: Models of the kind's entry in `cell.yaml`.
        description: Description of the kind in the documents.
        template: Commented lines of the kind in a new `cell.yaml`.
        usual: Function from a random generator to a typical target for simulations.
        printed: Function from print sizes to the fields of a target; None if the kind cannot be printed.
        entry_index: Index in `entries` of the model that reads an entry with these fields.
        figures: Small targets for the documents, by the name of the image.
        marks: Markings that distinguish a target from others of its kind in images; empty if there are none.
        numbered_fields: Fields of target n in a cell, counted from 0, with marks of its own if possible.
    """

    entries: tuple[type[TargetEntry], ...]
    description: KindDescription
    template: str
    usual: Callable[[np.random.Generator], Target]
    printed: Callable[[PrintSizes], Fields] | None = None
    entry_index: Callable[[Fields], int] = lambda _: 0
    figures: Mapping[str, Target] = field(default_factory=dict)
    marks: Callable[[Fields], frozenset[str]] = lambda _: frozenset()
    numbered_fields: Callable[[Fields, int], Fields] = lambda fields, _: fields


def choose_dictionary(usual: Sequence[str], first: str, index: int) -> str:
    """Name number `index` of the list of `first` and the other usual names; the last name if the list is shorter."""
    ordered = [first, *(name for name in usual if name != first)]
    return ordered[min(index, len(ordered) - 1)]


def is_indistinguishable(kind: TargetKind, first: Fields, second: Fields) -> bool:
    """Whether images cannot distinguish two targets of a kind."""
    marks, others = kind.marks(first), kind.marks(second)
    return bool(marks & others) or not (marks or others)


def plane_grid(columns: int, rows: int, pitch: float, origin: float = 0.0) -> Array:
    """Row-major grid in the plane z = 0, (rows * columns, 3): x along columns, y along rows."""
    v, u = np.mgrid[0:rows, 0:columns]
    return np.stack([u.ravel() * pitch + origin, v.ravel() * pitch + origin, np.zeros(u.size)], -1)
