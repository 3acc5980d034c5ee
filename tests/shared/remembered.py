"""Functions that compute once for equal arguments: commands of one test file often request the same."""

from __future__ import annotations

import io
import pickle
from collections.abc import Callable, Iterator
from functools import wraps
from types import FunctionType, MethodType, ModuleType
from typing import Any

import pytest


class _ArgumentPickler(pickle.Pickler):
    """Pickles arguments; functions among them, which are told the progress, by their names."""

    def reducer_override(self, value: Any) -> Any:
        if isinstance(value, FunctionType | MethodType):
            return str, (value.__qualname__,)
        return NotImplemented


def _argument_key(*arguments: Any) -> bytes:
    stream = io.BytesIO()
    _ArgumentPickler(stream).dump(arguments)
    return stream.getvalue()


def remember(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function, which keeps its results by the pickles of their arguments."""
    results: dict[bytes, Any] = {}

    @wraps(function)
    def call(*args: Any, **options: Any) -> Any:
        key = _argument_key(args, options)
        if key not in results:
            results[key] = function(*args, **options)
        return results[key]

    return call


def remembering(module: ModuleType, name: str) -> Any:
    """A fixture of a test file, in which a module's function is called once for equal arguments."""

    @pytest.fixture(scope="module", autouse=True)
    def remembered() -> Iterator[None]:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, name, remember(getattr(module, name)))
            yield

    return remembered
