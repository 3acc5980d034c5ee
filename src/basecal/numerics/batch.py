"""Nouns of arrays with a leading batch axis, taken apart and put together as one.

A noun is a dataclass, a tuple or a mapping of arrays and further nouns. Every array of it carries the batch, but for a
`Camera` of a single lens, which all entries share, and fields of metadata `SHARED`. What is no array is shared, too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, TypeVar

import numpy as np

from basecal.geometry import SE3, Array, BoolArray, Camera, Rows

T = TypeVar("T")
SHARED = {"shared": True}


def take(noun: T, rows: Rows | BoolArray | int) -> T:
    """The entries of a batch at these rows; without the batch axis where `rows` is a number."""
    if isinstance(rows, np.ndarray) and rows.dtype == np.bool_ and rows.all():
        return noun
    taken: T = _map_fields(lambda arrays: arrays[0][rows], [noun])
    return taken


def choose_entries(mask: BoolArray, first: T, second: T) -> T:
    """The entries of `first` where `mask`, (b,), holds, of `second` elsewhere."""
    if mask.all():
        return first
    if not mask.any():
        return second

    def select(arrays: Sequence[Array]) -> Array:
        """Entries of the two arrays."""
        one, other = arrays
        return np.where(mask.reshape(len(mask), *[1] * (one.ndim - 1)), one, other)

    mixed: T = _map_fields(select, [first, second])
    return mixed


def concatenate(nouns: Sequence[T]) -> T:
    """One batch of several."""
    joined: T = nouns[0] if len(nouns) == 1 else _map_fields(np.concatenate, nouns)
    return joined


def stack(nouns: Sequence[T]) -> T:
    """A batch of nouns that have no batch axis and are equal in all that is shared."""
    stacked: T = _map_fields(np.stack, nouns, is_batch=False)
    return stacked


def _map_fields(change: Callable[[Sequence[Array]], Array], nouns: Sequence[Any], is_batch: bool = True) -> Any:
    first = nouns[0]
    if isinstance(first, np.ndarray):
        return change(nouns)
    if isinstance(first, SE3):
        return SE3.adopt(change([n.rotation for n in nouns]), change([n.translation for n in nouns]))
    if isinstance(first, Camera):
        shared = is_batch and first.parameters.ndim == 1
        return first if shared else first.with_parameters(change([n.parameters for n in nouns]))
    if is_dataclass(first) and not isinstance(first, type):
        # Without the dataclass's own `replace`, which takes longer than the arrays do: nouns of batches check nothing.
        values = {name: getattr(first, name) for name in _names(type(first), True)}
        for name in _names(type(first), False):
            values[name] = _map_fields(change, [getattr(n, name) for n in nouns], is_batch)
        made = object.__new__(type(first))
        made.__dict__.update(values)
        return made
    if isinstance(first, Mapping):
        return {key: _map_fields(change, [n[key] for n in nouns], is_batch) for key in first}
    if isinstance(first, tuple):
        entries = [_map_fields(change, each, is_batch) for each in zip(*nouns, strict=True)]
        return type(first)(*entries) if hasattr(first, "_fields") else tuple(entries)
    return first


@cache
def _names(kind: type, is_shared: bool) -> tuple[str, ...]:
    """Names of a dataclass's fields that all entries share, or of the others."""
    return tuple(f.name for f in fields(kind) if bool(f.metadata.get("shared")) == is_shared)
