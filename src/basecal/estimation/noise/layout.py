"""Positions of the random effects of a mixed model, in blocks of errors and in columns.

Stops that share views with few other stops form a block with them. Stops that share views with many are columns, as
are shared errors and shapes of targets.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from basecal.effects.faces.shared_errors import SharedErrors
from basecal.estimation.noise.shaped_targets import shaped_targets
from basecal.estimation.problem.problem import Problem
from basecal.geometry import Array, IntArray
from basecal.numerics.tied_blocks import tied_blocks

# Maximum number of stops in a block: two arms that each visited one place twice.
_MOST_BLOCK_STOPS = 4
_MOST_PADDING = 16_384  # numbers that take as long to process as NumPy's calls on one more chunk
_CHUNK_NUMBERS = (
    131_072  # numbers of an array over blocks that are processed at a time: 1 MB fits into the processor's cache
)


@dataclass(frozen=True, eq=False)
class Layout:
    """Positions of the random effects of a mixed model in its blocks and columns.

    Attributes:
        block: (k,) block of each stop's error; -1 if it is among the columns.
        row: (k,) first row of each stop's error in its block; -1 if it is among the columns.
        column: (k,) first column of each stop's error; -1 if it is in a block.
        sizes: (b,) number of rows in use of each block, ascending; blocks are padded to the largest one.
        width: Number of columns.
        shared: For each kind of shared errors, their first column and the errors, by robot.
        shapes: Columns of the shape of each target, by name.
        jitter_rows: Block, and row in it, of the timing jitter of each view, (n,) each, by group; -1 without jitter.
    """

    block: IntArray
    row: IntArray
    column: IntArray
    sizes: IntArray
    width: int
    shared: tuple[Mapping[str, tuple[int, SharedErrors]], ...]
    shapes: Mapping[str, slice]
    jitter_rows: tuple[tuple[IntArray, IntArray], ...]

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return len(self.sizes)

    @property
    def rows(self) -> int:
        """Number of rows of each block, padding included."""
        return int(self.sizes.max(initial=0))

    def chunks(self, columns: int) -> Iterator[tuple[slice, slice]]:
        """Yield slices of blocks to process together, each with the slice of the rows that these blocks use."""
        first = 0
        for last in _ends_of_sizes(self.sizes, columns):
            rows = int(self.sizes[last - 1])
            for here in chunks(last - first, rows, columns, _CHUNK_NUMBERS):
                yield slice(first + here.start, min(first + here.stop, last)), slice(rows)
            first = last

    def shared_columns(self, robot: str) -> Iterator[tuple[slice, Array]]:
        """Yield the columns of a robot's shared errors and the derivative of its flange poses, (stops, 6, k)."""
        for first, errors in (by_robot[robot] for by_robot in self.shared if robot in by_robot):
            yield slice(first, first + len(errors.is_turn)), errors.by_stop


def place_effects(problem: Problem, shared_errors: Sequence[Mapping[str, SharedErrors]]) -> Layout:
    """Place the errors of stops, shared errors by kind and robot, jitter, and shapes of targets."""
    count = len(problem.stops)
    pairs = np.concatenate([np.column_stack([end.stop for end in g.ends]) for g in problem.groups])
    scene_stops = [] if problem.tied is None else problem.tied.stops.tolist()
    partition = tied_blocks(pairs[(pairs >= 0).all(1)], count, _MOST_BLOCK_STOPS, scene_stops)
    row, column = np.where(partition.block >= 0, 6 * partition.place, -1), np.full(count, -1, dtype=np.int64)
    jitter_rows, sizes = _jitter_layout(
        problem, partition.block, 6 * np.bincount(partition.block[partition.block >= 0])
    )
    order = np.argsort(sizes, kind="stable")
    number = np.append(np.argsort(order), -1)  # new number of each block; -1 stays
    width = problem.width
    for stop in partition.hubs:
        column[stop] = width
        width += 6
    shared_places: tuple[dict[str, tuple[int, SharedErrors]], ...] = tuple({} for _ in shared_errors)
    for of_kind, by_robot in zip(shared_places, shared_errors, strict=True):
        for robot, errors in by_robot.items():
            of_kind[robot] = (width, errors)
            width += len(errors.is_turn)
    shapes = {}
    for target, count in shaped_targets(problem).items():
        shapes[target] = slice(width, width + count)
        width += count
    jitter_rows = tuple((number[block], row_in_block) for block, row_in_block in jitter_rows)
    return Layout(number[partition.block], row, column, sizes[order], width, shared_places, shapes, jitter_rows)


def _jitter_layout(
    problem: Problem, block: IntArray, sizes: IntArray
) -> tuple[tuple[tuple[IntArray, IntArray], ...], IntArray]:
    """Place the timing jitter of each view: in the row below its stops' errors, or in a block of its own.

    Views in motion rarely share a stop. If several views share a block, only the first has a jitter row.

    Returns:
        `Layout.jitter_rows`, and the number of rows of each block.
    """
    places, used_blocks, rows = [], set[int](), sizes.tolist()
    for group in problem.groups:
        own, row = (np.full(len(group), -1, dtype=np.int64) for _ in range(2))
        stops = [end.stop for end in group.ends]
        has_jitter = group.camera in problem.open_jitter or problem.jitter_motion(group) is not None
        for view in range(len(group)) if has_jitter and group.motion is not None else ():
            of_stops = [int(block[s[view]]) for s in stops if s[view] >= 0]
            own_block = max(of_stops, default=-1)
            if own_block < 0:
                own_block = len(rows)
                rows.append(0)
            if own_block not in used_blocks:
                used_blocks.add(own_block)
                own[view], row[view] = own_block, rows[own_block]
                rows[own_block] += 1
        places.append((own, row))
    return tuple(places), np.array(rows, dtype=np.int64)


def _ends_of_sizes(sizes: IntArray, columns: int) -> list[int]:
    """Ends of runs of blocks that are processed with the same number of rows; sizes are (b,) ascending.

    Blocks of one size form a run, and take the next size if their padding costs less than calls on one more run.
    """
    ends = (np.flatnonzero(np.diff(sizes)) + 1).tolist()
    kept, first = [], 0
    for end, next_end in pairwise([*ends, len(sizes)]):
        padding = (end - first) * (sizes[next_end - 1] - sizes[end - 1]) * (columns + sizes[next_end - 1])
        if padding > _MOST_PADDING:
            kept.append(end)
            first = end
    return [*kept, len(sizes)] if len(sizes) else []


def chunks(blocks: int, rows: int, columns: int, max_count: int) -> list[slice]:
    """Slices over blocks of the given rows and columns, each with at most `max_count` numbers or a single block."""
    size = max(1, max_count // max(1, rows * columns))
    return [slice(first, first + size) for first in range(0, blocks, size)]
