"""Tests of `basecal.estimation.noise.layout`: places of stop errors in blocks and columns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.pose_problem import CHAINED, EXACT, OWN, SINGLE, STAR, shaken, two_arm_problem

from basecal.estimation.noise.layout import chunks
from basecal.estimation.noise.mixed_model import mixed_model

ROBOTS = ("eye", "hand")


@pytest.mark.parametrize(
    ("stops", "block", "row", "column", "sizes", "jitter"),
    [
        (OWN, [0, 1, 2, 3], [0] * 4, [-1] * 4, [6] * 4, [0, 1, 2, 3]),
        (CHAINED, [1, 1, 0, 1, 1, 0], [0, 6, 0, 12, 18, 6], [-1] * 6, [12, 24], [1, -1, -1, 0]),
        (STAR, [0, 1, 2, 3, 4, 5, -1, 5], [0] * 6 + [-1, 6], [-1] * 6 + [6, -1], [6] * 5 + [12], [0, 1, 2, 3, 4, 5]),
        (EXACT, [], [], [], [], [0, 1, 2]),
        (SINGLE, [0, 0], [0, 6], [-1, -1], [12], [0]),
    ],
)
@pytest.mark.parametrize("known_s", [None, 0.0, 2.0])
def test_each_stop_is_in_a_block_or_column(stops, block, row, column, sizes, jitter, known_s):
    """Stops of one block are in rows of six, and jitter is in the row below.

    A stop that connects more than four others is among the columns. The first of the views that share a block has a row
    for its jitter; without stops each has a block of its own. Small blocks come first.
    """
    problem, state = two_arm_problem(np.zeros((len(stops[0]), 6)), *stops)
    moving = problem if known_s is None else shaken(problem, len(stops[0]), known_s)[0]
    layout = mixed_model(moving, state, ROBOTS).layout
    for found, expected in ((layout.block, block), (layout.row, row), (layout.column, column)):
        assert found.tolist() == expected
    as_stamped = mixed_model(replace(moving, open_jitter=frozenset(), jitter_s={}), state, ROBOTS).layout
    assert as_stamped.sizes.tolist() == sizes
    jitter = [-1 if known_s is None else of for of in jitter]
    ((of_views, row_of_views),) = layout.jitter_rows
    assert of_views.tolist() == jitter
    sizes = sizes or [0] * (len(jitter) * (known_s is not None))
    assert row_of_views.tolist() == [-1 if of < 0 else sizes[of] for of in jitter]
    assert layout.sizes.tolist() == [size + (known_s is not None) for size in sizes]
    assert layout.blocks == max(*block, *jitter, -1) + 1
    assert (layout.rows, layout.width) == (max(layout.sizes, default=0), 6 + 6 * sum(at >= 0 for at in column))


def test_chunks_are_limited_to_a_megabyte():
    """A chunk has at least one block, and blocks without numbers form one chunk."""
    assert chunks(5, 2, 10, 40) == [slice(0, 2), slice(2, 4), slice(4, 6)]
    assert chunks(2, 2, 10, 1) == [slice(0, 1), slice(1, 2)]
    assert chunks(3, 0, 7, 40) == [slice(0, 40)]
    assert chunks(0, 2, 7, 40) == []


def test_blocks_of_equal_size_are_processed_together(monkeypatch):
    """Small blocks are padded to the next size only if that adds little."""
    layout = mixed_model(*two_arm_problem(np.zeros((6, 6)), *STAR), ROBOTS).layout
    assert layout.sizes.tolist() == [6] * 5 + [12]
    added = 5 * 6 * (7 + 12)
    for little, expected in ((added, [(0, 6, 12)]), (added - 1, [(0, 5, 6), (5, 6, 12)])):
        monkeypatch.setattr("basecal.estimation.noise.layout._MOST_PADDING", little)
        assert [(blocks.start, blocks.stop, rows.stop) for blocks, rows in layout.chunks(7)] == expected
    monkeypatch.setattr("basecal.estimation.noise.layout._CHUNK_NUMBERS", 2 * 6 * 7)
    assert [(blocks.start, blocks.stop) for blocks, _ in layout.chunks(7)] == [(0, 2), (2, 4), (4, 5), (5, 6)]
    assert list(replace(layout, sizes=layout.sizes[:0]).chunks(7)) == []
