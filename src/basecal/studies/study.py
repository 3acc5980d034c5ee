"""A study: axes whose values make points, each point trials on a few cells; cut into chunks that never change."""

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
"""Trials of one cell that are drawn by one generator and solved side by side: more gain nothing, and take memory."""

_MOST_CELLS = 20  # of a chunk, each of which has to be made and started on: some seconds in all
_FORMAT = 2  # of what a chunk holds: counts up where the same study gives other numbers


@dataclass(frozen=True)
class Point:
    """A value for each axis.

    Attributes:
        index: Which of the study's points.
        at: Its value on each axis.
        settings: Those and all that is held.
    """

    index: int
    at: Mapping[str, Any]
    settings: Mapping[str, Any]

    @property
    def label(self) -> dict[str, str | float | int | bool]:
        """Its value on each axis, as a word or a number."""
        return {name: label(value) for name, value in self.at.items()}


@dataclass(frozen=True)
class Piece:
    """Trials of one cell of a point, at most `BLOCK`, drawn by one generator.

    Attributes:
        cell: Which cell.
        block: Which generator of the cell.
        first: Number of its first trial among the point's.
        count: How many trials.
    """

    cell: int
    block: int
    first: int
    count: int


@dataclass(frozen=True)
class Chunk:
    """The unit of work of one process, kept in one file.

    Attributes:
        index: Which of the study's chunks.
        point: The point.
        pieces: Its trials.
    """

    index: int
    point: Point
    pieces: tuple[Piece, ...]

    @property
    def trials(self) -> int:
        """How many."""
        return sum(piece.count for piece in self.pieces)


@dataclass(frozen=True)
class Study:
    """The varied and the fixed settings of a study, and its number of trials.

    Attributes:
        title: Its name.
        about: What it is for.
        seed: Of everything drawn.
        trials: Of each point.
        cells: Over how many cells these are spread.
        transform: Which transform is judged; the first that a cell is calibrated for where None.
        held: Settings that all points have, those of axes by default.
        axes: Values by name.
        text: The file, as it is written.
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
        """Every combination of the axes' values, those of the last axis next to one another."""
        at = [dict(zip(self.axes, values, strict=True)) for values in product(*self.axes.values())]
        return tuple(Point(index, each, {**self.held, **each}) for index, each in enumerate(at))

    @cached_property
    def chunks(self) -> tuple[Chunk, ...]:
        """All trials; the same whoever works on them."""
        groups = [(point, pieces) for point in self.points for pieces in self._group_pieces(point)]
        return tuple(Chunk(index, point, pieces) for index, (point, pieces) in enumerate(groups))

    def _group_pieces(self, point: Point) -> Iterator[tuple[Piece, ...]]:
        most = BLOCK * SOLVERS[point.settings["solver"]].blocks
        group: list[Piece] = []
        for piece in self._pieces():
            cells = {each.cell for each in (*group, piece)}
            full = sum(each.count for each in group) + piece.count > most or len(cells) > _MOST_CELLS
            if group and full:
                yield tuple(group)
                group = []
            group.append(piece)
        yield tuple(group)

    def _pieces(self) -> Iterator[Piece]:
        """The trials of a point, as evenly over the cells as they go."""
        first = 0
        for cell in range(self.cells):
            own = self.trials // self.cells + (cell < self.trials % self.cells)
            for block, start in enumerate(range(0, own, BLOCK)):
                count = min(BLOCK, own - start)
                yield Piece(cell, block, first, count)
                first += count

    @cached_property
    def identity(self) -> str:
        """A hash of all that decides the numbers; what it is called and what is said of it are no part."""
        said = [_FORMAT, self.seed, self.trials, self.cells, self.transform]
        axes = [(name, [_plain(value) for value in values]) for name, values in self.axes.items()]
        held = {name: _plain(value) for name, value in self.held.items() if name not in self.axes}
        return hashlib.sha256(json.dumps([*said, axes, held], sort_keys=True).encode()).hexdigest()


def _plain(value: Any) -> Any:
    return value.model_dump() if isinstance(value, TargetEntry) else value


def label(value: Any) -> str | float | int | bool:
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
