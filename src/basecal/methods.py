"""Functions of upper layers that nouns offer as methods: `basecal` enters them, nothing here is imported upward."""

from __future__ import annotations

from collections.abc import Callable

METHODS: dict[str, Callable[..., object]] = {}
"""By name: `export`, `export_kinds`, `html_summary`."""
