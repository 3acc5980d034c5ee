"""Registry of functions of upper layers that classes offer as methods; `basecal` fills it to avoid upward imports."""

from __future__ import annotations

from collections.abc import Callable

METHODS: dict[str, Callable[..., object]] = {}
"""Functions by name: `export`, `export_kinds`, `html_summary`."""
