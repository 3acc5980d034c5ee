"""Cached functions: commands of one test file often compute the same."""

from __future__ import annotations

import io
import pickle
from collections.abc import Callable, Iterator
from functools import wraps
from types import FunctionType, MethodType, ModuleType
from typing import Any

import pytest


class _ArgumentPickler(pickle.Pickler):
    """Pickles arguments; functions among them, which receive the progress, by their names."""

    def reducer_override(self, value: Any) -> Any:
        if isinstance(value, FunctionType | MethodType):
            return str, (value.__qualname__,)
        return NotImplemented


def _argument_key(*arguments: Any) -> bytes:
    stream = io.BytesIO()
    _ArgumentPickler(stream).dump(arguments)
    return stream.getvalue()


def remember(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function with a cache of results by the pickles of their arguments."""
    results: dict[bytes, Any] = {}

    @wraps(function)
    def call(*args: Any, **options: Any) -> Any:
        key = _argument_key(args, options)
        if key not in results:
            results[key] = function(*args, **options)
        return results[key]

    return call


def remembering(module: ModuleType, name: str) -> Any:
    """A fixture of a test file that caches the results of a module's function."""

    @pytest.fixture(scope="module", autouse=True)
    def remembered() -> Iterator[None]:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, name, remember(getattr(module, name)))
            yield

    return remembered
