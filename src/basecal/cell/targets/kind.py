"""The face of a kind of target: its module in this folder ends in a `KIND` of this class."""

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
    """A target in `cell.yaml`; this one is seen only as poses, each kind has its own."""

    on: str
    mount: Mount = UnknownEntry()
    size_sigma: Sigma | None = None
    exact: bool = False
    scale: Literal["free"] | None = None

    @model_validator(mode="after")
    def _size(self) -> Self:
        if self.exact and self.size_sigma is not None:
            raise ValueError("exact takes no size_sigma: leave one of them away")
        if self.scale and (self.exact or self.size_sigma is not None or type(self) is not TargetEntry):
            raise ValueError("scale is of a target that is seen only as poses: leave kind, exact and size_sigma away")
        return self

    def shape(self) -> Target | None:
        """The target it describes; None if it is seen only as poses."""
        return None


@dataclass(frozen=True)
class PrintSizes:
    """Sizes to print, as requested of `basecal target`; lengths in metres."""

    columns: int
    rows: int
    square_m: float
    marker_m: float
    dictionary: str
    family: str
    tag: int


class Described(NamedTuple):
    """A kind's row in docs/data_format.md."""

    fields: str
    ids: str
    origin: str


@dataclass(frozen=True)
class TargetKind:
    """Properties of a kind of target that are not particular to one target.

    Attributes:
        entries: Models of its entry in `cell.yaml`.
        described: What the documents say of it.
        template: Its lines in a new `cell.yaml`, explained.
        usual: One as a simulation has it, from a random generator.
        printed: Fields of one to print; None if there is nothing to choose.
        entry_index: Index of the one of `entries` that reads an entry with these fields.
        figures: Small ones for the documents, by the name of the image.
        marks: Fields by which images distinguish one from another of its kind; empty if they cannot.
        another: Fields of the n-th of several in a cell, counted from 0, with marks of its own as far as there are any.
    """

    entries: tuple[type[TargetEntry], ...]
    described: Described
    template: str
    usual: Callable[[np.random.Generator], Target]
    printed: Callable[[PrintSizes], Fields] | None = None
    entry_index: Callable[[Fields], int] = lambda _: 0
    figures: Mapping[str, Target] = field(default_factory=dict)
    marks: Callable[[Fields], frozenset[str]] = lambda _: frozenset()
    another: Callable[[Fields, int], Fields] = lambda fields, _: fields


def choose_dictionary(usual: Sequence[str], first: str, place: int) -> str:
    """The one at a place among what is usual, that which was said being the first; the last where there are fewer."""
    ordered = [first, *(name for name in usual if name != first)]
    return ordered[min(place, len(ordered) - 1)]


def is_indistinguishable(kind: TargetKind, first: Fields, second: Fields) -> bool:
    """Whether no image determines which of two of a kind it shows."""
    marks, others = kind.marks(first), kind.marks(second)
    return bool(marks & others) or not (marks or others)


def plane_grid(columns: int, rows: int, pitch: float, origin: float = 0.0) -> Array:
    """Row-major grid in the plane z = 0, (rows * columns, 3): x along columns, y along rows."""
    v, u = np.mgrid[0:rows, 0:columns]
    return np.stack([u.ravel() * pitch + origin, v.ravel() * pitch + origin, np.zeros(u.size)], -1)
