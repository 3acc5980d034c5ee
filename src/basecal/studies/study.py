"""A study: a grid of points, each with trials on a few cells, and its fixed division into chunks."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Any

from basecal.cell.targets.kind import TargetEntry
from basecal.studies.solvers.registry import SOLVERS

BLOCK = 256
"""Trials of one cell with one generator, solved as one batch: a larger batch is not faster, but needs memory."""

_MOST_CELLS = 20  # of a chunk: the preparation of that many cells takes some seconds
_FORMAT_VERSION = 2  # version of a chunk's content: incremented if the same study gives other numbers


@dataclass(frozen=True)
class Point:
    """A point of a study: one value for each axis.

    Attributes:
        index: Index of the point in the study.
        at: Value on each axis.
        settings: The values on the axes, and the fixed settings.
    """

    index: int
    at: Mapping[str, Any]
    settings: Mapping[str, Any]

    @property
    def label(self) -> dict[str, str | float | int | bool]:
        """Value on each axis, as a word or a number."""
        return {name: axis_label(value) for name, value in self.at.items()}


@dataclass(frozen=True)
class Piece:
    """At most `BLOCK` trials of one cell of a point, drawn by one generator.

    Attributes:
        cell: Number of the cell.
        block: Number of the generator within the cell.
        first: Number of the first trial within the point.
        count: Number of trials.
    """

    cell: int
    block: int
    first: int
    count: int


@dataclass(frozen=True)
class Chunk:
    """The unit of work of one process, stored in one file.

    Attributes:
        index: Index of the chunk in the study.
        point: The point.
        pieces: The trials.
    """

    index: int
    point: Point
    pieces: tuple[Piece, ...]

    @property
    def trials(self) -> int:
        """Number of trials."""
        return sum(piece.count for piece in self.pieces)


@dataclass(frozen=True)
class Study:
    """The varied and the fixed settings of a study, and its number of trials.

    Attributes:
        title: Name of the study.
        about: Purpose of the study.
        seed: Seed of all random draws.
        trials: Number of trials of each point.
        cells: Number of cells on which the trials of a point are distributed.
        transform: Name of the evaluated transform; None for the first requested one of a cell.
        held: Fixed settings of all points; values of axes override them.
        axes: Values of the axes, by name.
        text: Text of the study's file.
    """

    title: str
    about: str
    seed: int
    trials: int
    cells: int
    transform: str | None
    held: Mapping[str, Any]
    axes: Mapping[str, tuple[Any, ...]]
    text: str = field(compare=False)

    @cached_property
    def points(self) -> tuple[Point, ...]:
        """All combinations of the axes' values; the last axis varies fastest."""
        at = [dict(zip(self.axes, values, strict=True)) for values in product(*self.axes.values())]
        return tuple(Point(index, each, {**self.held, **each}) for index, each in enumerate(at))

    @cached_property
    def chunks(self) -> tuple[Chunk, ...]:
        """Division of all trials into chunks; it does not depend on the workers."""
        groups = [(point, pieces) for point in self.points for pieces in self._group_pieces(point)]
        return tuple(Chunk(index, point, pieces) for index, (point, pieces) in enumerate(groups))

    def _group_pieces(self, point: Point) -> Iterator[tuple[Piece, ...]]:
        largest_count = BLOCK * SOLVERS[point.settings["solver"]].blocks
        group: list[Piece] = []
        for piece in self._pieces():
            cells = {each.cell for each in (*group, piece)}
            is_full = sum(each.count for each in group) + piece.count > largest_count or len(cells) > _MOST_CELLS
            if group and is_full:
                yield tuple(group)
                group = []
            group.append(piece)
        yield tuple(group)

    def _pieces(self) -> Iterator[Piece]:
        """The trials of a point, distributed evenly among the cells."""
        first = 0
        for cell in range(self.cells):
            cell_trials = self.trials // self.cells + (cell < self.trials % self.cells)
            for block, start in enumerate(range(0, cell_trials, BLOCK)):
                count = min(BLOCK, cell_trials - start)
                yield Piece(cell, block, first, count)
                first += count

    @cached_property
    def identity(self) -> str:
        """Hash of all inputs that determine the results; title and description are not included."""
        numbers = [_FORMAT_VERSION, self.seed, self.trials, self.cells, self.transform]
        axes = [(name, [_plain(value) for value in values]) for name, values in self.axes.items()]
        held = {name: _plain(value) for name, value in self.held.items() if name not in self.axes}
        return hashlib.sha256(json.dumps([*numbers, axes, held], sort_keys=True).encode()).hexdigest()


def _plain(value: Any) -> Any:
    return value.model_dump() if isinstance(value, TargetEntry) else value


def axis_label(value: Any) -> str | float | int | bool:
    """A value of an axis as a word or a number; a board as its kind and sizes."""
    if not isinstance(value, TargetEntry):
        word: str | float | int | bool = value
        return word
    target = value.shape()
    if target is None:
        return "pose"
    options = [
        _abbreviate(option) for option in target.options.values() if not isinstance(option, list) or len(option) < 4
    ]
    return " ".join([target.kind, *(option for option in options if option)])


def _abbreviate(option: Any) -> str:
    if isinstance(option, bool) or option is None:
        return ""
    return (
        "x".join(f"{each:g}" for each in option if isinstance(each, int | float))
        if isinstance(option, list)
        else (f"{option:g}" if isinstance(option, int | float) else str(option))
    )
