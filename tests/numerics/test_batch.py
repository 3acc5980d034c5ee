"""Tests of indexing, concatenating, stacking and choosing among batches of containers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from basecal.geometry import SE3, Array, Camera
from basecal.numerics.batch import SHARED, choose_entries, concatenate, space_evenly, stack, take


@dataclass(frozen=True, eq=False)
class Container:
    """A container with all types of fields that a batch supports."""

    poses: dict[str, SE3]
    lens: Camera
    parts: tuple[Array, ...]
    table: Array = field(metadata=SHARED)
    nothing: None = None


def container(rng: np.random.Generator, count: int, table: Array) -> Container:
    pose = SE3.exp(rng.standard_normal((count, 6)))
    return Container({"a": pose}, Camera("pinhole", [9.0, 9.0, 1.0, 1.0]), (rng.standard_normal((count, 2, 3)),), table)


def test_take_and_concatenate_are_inverse(rng):
    """Concatenating all rows of a batch restores the batch, and shared fields are kept without a copy."""
    table = np.arange(7.0)
    whole = container(rng, 5, table)
    again = concatenate([take(whole, np.array([row])) for row in range(5)])
    np.testing.assert_array_equal(again.poses["a"].matrix, whole.poses["a"].matrix)
    np.testing.assert_array_equal(again.parts[0], whole.parts[0])
    assert again.table is table
    assert again.lens is whole.lens


def test_stack_adds_batch_axis(rng):
    """Stacked single containers, indexed by number, return the originals, lenses included."""
    whole = container(rng, 3, np.zeros(1))
    singles = [take(whole, row) for row in range(3)]
    assert singles[0].poses["a"].shape == ()
    stacked = stack(singles)
    assert stacked.lens.parameters.shape == (3, 4)
    np.testing.assert_array_equal(take(stacked, 2).poses["a"].matrix, singles[2].poses["a"].matrix)
    np.testing.assert_array_equal(take(stacked, 2).lens.parameters, singles[2].lens.parameters)


def test_choose_entries_selects_row_by_row(rng):
    """Each row is from the first container if the mask is true, else from the second."""
    first, second = (container(rng, 4, np.zeros(1)) for _ in range(2))
    mask = np.array([True, False, False, True])
    mixed = choose_entries(mask, first, second)
    for row in range(4):
        chosen = first if mask[row] else second
        np.testing.assert_array_equal(mixed.poses["a"].matrix[row], chosen.poses["a"].matrix[row])
        np.testing.assert_array_equal(mixed.parts[0][row], chosen.parts[0][row])
    assert choose_entries(np.ones(4, dtype=bool), first, second) is first
    assert choose_entries(np.zeros(4, dtype=bool), first, second) is second


class Pair(NamedTuple):
    """A named tuple of two arrays."""

    first: Array
    second: Array


def test_take_preserves_named_tuple_type(rng):
    """Rows of a named tuple are a named tuple of the same type."""
    pair = Pair(rng.standard_normal(4), rng.standard_normal((4, 2)))
    few = take(pair, np.array([2, 0]))
    assert isinstance(few, Pair)
    np.testing.assert_array_equal(few.second, pair.second[[2, 0]])


def test_entries_are_evenly_spaced():
    """The first and last entry are among them, all differ, and few entries are all returned."""
    assert space_evenly(10, 4).tolist() == [0, 3, 6, 9]
    assert space_evenly(9, 4).tolist() == [0, 2, 5, 8]
    assert space_evenly(3, 4).tolist() == [0, 1, 2]
    assert space_evenly(0, 4).tolist() == []
