"""Array types, and read-only copies of arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from basecal.errors import InputError

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Rows = NDArray[np.intp] | NDArray[np.int64] | slice


def read_only(values: ArrayLike, shape: tuple[int | None, ...] | None = None, name: str = "array") -> Array:
    """Make a read-only float64 copy.

    Args:
        values: Anything that NumPy converts to numbers.
        shape: Expected shape of the last axes; None represents any length.
        name: Name of the array in errors.

    Raises:
        InputError: if the values are not numbers, or the last axes do not have `shape`.
    """
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} is not an array of numbers{_shape_clause(shape)}") from None
    if shape is not None:
        tail = array.shape[array.ndim - len(shape) :] if array.ndim >= len(shape) else None
        if tail is None or any(want is not None and want != got for want, got in zip(shape, tail, strict=True)):
            raise InputError(f"{name} has shape {array.shape}{_shape_clause(shape)}")
    array.setflags(write=False)
    return array


class ReadOnlyArrays:
    """Base of nouns whose arrays are read-only: they remain so in copies, which NumPy makes writable otherwise."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take the fields of an unpickled or a deep copy."""
        for value in state.values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
        self.__dict__.update(state)


def entry_clause(is_wrong: BoolArray | np.bool_) -> str:
    """Words for the first wrong entry of a batch, (n,); empty for a single one, ()."""
    return f" in entry {np.flatnonzero(is_wrong)[0]}, counted from 0" if is_wrong.ndim == 1 else ""


def with_last_axis(values: ArrayLike, length: int, name: str) -> Array:
    """Convert values to float64, (..., length); they are copied only if they have another type.

    Raises:
        InputError: if the values are not numbers, or the last axis has another length.
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} is not an array of numbers, expected (..., {length})") from None
    if array.shape[-1:] != (length,):
        raise InputError(f"{name} has shape {array.shape}, expected (..., {length})")
    return array


def _shape_clause(shape: tuple[int | None, ...] | None) -> str:
    return "" if shape is None else f", expected (..., {', '.join(map(str, shape))})"


def to_front(array: Array, axis: int) -> Array:
    """View with an axis moved to the front: five times as fast as `np.moveaxis`, which matters for small arrays."""
    order = list(range(array.ndim))
    order.insert(0, order.pop(axis))
    return array.transpose(order)


def to_back(array: Array, axes: int = 1) -> Array:
    """View with the first `axes` axes moved to the back, in their order; faster than `np.moveaxis`."""
    order = range(array.ndim)
    return array.transpose(*order[axes:], *order[:axes])


def read_only_ids(values: Any) -> IntArray:
    """Make a read-only int64 copy of point ids."""
    array = np.array(values, dtype=np.int64)
    array.setflags(write=False)
    return array
