"""A UR controller in a separate process, and the place of its robot in a cell."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path

from basecal.acquisition.driver import Place
from shared.facing_arms import facing_arms
from shared.second_process import own_host, second_process

CELL = facing_arms("led").cell


@contextmanager
def controller(*words):
    """A controller, and a function for the place of its robot in a cell with URDFs."""
    host = own_host()
    with second_process("shared.ur_controller", host, *words) as process:
        yield process, lambda **options: Place("eye", CELL, Path("."), {"host": host, "reconnect_s": 1.0, **options})
