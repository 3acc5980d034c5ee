"""What a command shows beside its answer: one JSON object for programs, progress for people."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any


def print_json(answer: Mapping[str, Any]) -> None:
    """One JSON object on stdout."""
    print(json.dumps(answer, allow_nan=False))


@contextmanager
def progress(message: str) -> Iterator[Callable[[str], None]]:
    """A spinner on stderr that names what is done now, while it takes long; nothing where stderr is no terminal."""
    if not sys.stderr.isatty():
        yield lambda now: None
        return
    from rich.console import Console

    with Console(stderr=True).status(message) as status:
        yield lambda now: status.update(f"{message}: {now}")


def print_stages(seconds: Mapping[str, float]) -> None:
    """Where the time went [s], on stderr: the longest stage first."""
    for name, took in sorted(seconds.items(), key=lambda stage: -stage[1]):
        print(f"{took:8.3f} s  {name}", file=sys.stderr)
    print(f"{sum(seconds.values()):8.3f} s  all stages", file=sys.stderr)
