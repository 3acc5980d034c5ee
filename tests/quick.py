"""Parameters of a test that fast tests try; `make test-slow` tries all."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def quick(values: Iterable[Any], fast: Collection[Any]) -> list[Any]:
    """All values, or tuples of them; those not in `fast` are marked slow."""
    return [value if value in fast else _slow(*value if isinstance(value, tuple) else (value,)) for value in values]


def _slow(*values: Any) -> Any:
    return pytest.param(*values, marks=pytest.mark.slow)
