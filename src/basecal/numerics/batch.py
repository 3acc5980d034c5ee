"""Select, stack and concatenate nested containers of arrays with a leading batch axis.

A container is a dataclass, a tuple or a mapping of arrays and further containers. Every array has the batch axis, with
two exceptions: a `Camera` with a single lens, and dataclass fields with metadata `SHARED`. These and all values that
are not arrays are shared by all entries.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, TypeVar

import numpy as np

from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray, Rows

T = TypeVar("T")
SHARED = {"shared": True}


def take(container: T, rows: Rows | BoolArray | int) -> T:
    """Select entries of a batch; without the batch axis if `rows` is a number."""
    if isinstance(rows, np.ndarray) and rows.dtype == np.bool_ and rows.all():
        return container
    taken: T = _map_fields(lambda arrays: arrays[0][rows], [container])
    return taken


def choose_entries(mask: BoolArray, first: T, second: T) -> T:
    """Entries of `first` where `mask`, (b,), is true, else of `second`."""
    if mask.all():
        return first
    if not mask.any():
        return second

    def select(arrays: Sequence[Array]) -> Array:
        """Select from the two arrays."""
        one, other = arrays
        return np.where(mask.reshape(len(mask), *[1] * (one.ndim - 1)), one, other)

    mixed: T = _map_fields(select, [first, second])
    return mixed


def space_evenly(count: int, max_count: int) -> IntArray:
    """Indices of at most `max_count` of `count` entries, evenly spaced from the first to the last."""
    return np.linspace(0, count - 1, min(count, max_count)).astype(np.int64)


def concatenate(containers: Sequence[T]) -> T:
    """Concatenate several batches."""
    joined: T = containers[0] if len(containers) == 1 else _map_fields(np.concatenate, containers)
    return joined


def stack(containers: Sequence[T]) -> T:
    """Stack containers without a batch axis to a batch; shared values must be equal."""
    stacked: T = _map_fields(np.stack, containers, is_batch=False)
    return stacked


def _map_fields(function: Callable[[Sequence[Array]], Array], containers: Sequence[Any], is_batch: bool = True) -> Any:
    first = containers[0]
    if isinstance(first, np.ndarray):
        return function(containers)
    if isinstance(first, SE3):
        return SE3.adopt(
            function([container.rotation for container in containers]),
            function([container.translation for container in containers]),
        )
    if isinstance(first, Camera):
        shared = is_batch and first.parameters.ndim == 1
        return first if shared else first.with_parameters(function([container.parameters for container in containers]))
    if is_dataclass(first) and not isinstance(first, type):
        # `dataclasses.replace` would take longer than the arrays do; batched dataclasses need no checks.
        values = {name: getattr(first, name) for name in _field_names(type(first), True)}
        for name in _field_names(type(first), False):
            values[name] = _map_fields(function, [getattr(container, name) for container in containers], is_batch)
        batch = object.__new__(type(first))
        batch.__dict__.update(values)
        return batch
    if isinstance(first, Mapping):
        return {key: _map_fields(function, [container[key] for container in containers], is_batch) for key in first}
    if isinstance(first, tuple):
        entries = [_map_fields(function, each, is_batch) for each in zip(*containers, strict=True)]
        return type(first)(*entries) if hasattr(first, "_fields") else tuple(entries)
    return first


@cache
def _field_names(kind: type, is_shared: bool) -> tuple[str, ...]:
    """Names of the shared fields of a dataclass, or of the other fields."""
    return tuple(f.name for f in fields(kind) if bool(f.metadata.get("shared")) == is_shared)
