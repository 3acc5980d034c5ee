"""What a command shows beside its answer: one JSON object for programs, progress for people."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any


def print_json(answer: Mapping[str, Any]) -> None:
    """One JSON object on stdout."""
    print(json.dumps(answer, allow_nan=False))


@contextmanager
def progress(message: str) -> Iterator[None]:
    """A spinner on stderr while something takes long; nothing where stderr is not a terminal."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console

    with Console(stderr=True).status(message):
        yield
