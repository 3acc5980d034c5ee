"""Which of many parameters of a test the fast tests try; `make test-slow` tries the others."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def quick(values: Iterable[Any], these: Collection[Any]) -> list[Any]:
    """All values, or tuples of them, those that are not among `these` marked slow."""
    return [value if value in these else _slow(*value if isinstance(value, tuple) else (value,)) for value in values]


def _slow(*values: Any) -> Any:
    return pytest.param(*values, marks=pytest.mark.slow)
