"""Consent of the computer's user to the locations outside a cell's folder that its drivers access."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from basecal.bounded_file import read_bounded
from basecal.cell.format.writing import write_private
from basecal.errors import DatasetError, InputError

_LARGEST_BYTES = 2**22  # bytes


def is_allowed(folder: Path, place: str) -> bool:
    """Whether the user allowed a cell to access a location, identified by the text of the question."""
    return place in _allowed_places().get(os.path.realpath(folder), [])


def allow(folder: Path, places: Iterable[str]) -> None:
    """Store that the user allows a cell to access locations; if writing fails, the user is asked again."""
    known, cell = _allowed_places(), os.path.realpath(folder)
    known[cell] = sorted({*known.get(cell, []), *places})
    with suppress(InputError, RuntimeError):
        write_private(_file(), json.dumps(known) + "\n")


def withdraw(folder: Path, place: str) -> None:
    """Remove the user's consent to a location."""
    known, cell = _allowed_places(), os.path.realpath(folder)
    remaining = [each for each in known.pop(cell, []) if each != place]
    with suppress(InputError, RuntimeError):
        write_private(_file(), json.dumps({**known, cell: remaining} if remaining else known) + "\n")


def _file() -> Path:
    """Path of the consent file in the user's state folder.

    Raises:
        RuntimeError: if the user has no home folder.
    """
    state = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(state) / "basecal" / "allowed.json"


def _allowed_places() -> dict[str, list[str]]:
    """Allowed locations by cell."""
    try:
        data = json.loads(read_bounded(_file(), _LARGEST_BYTES))
    except (DatasetError, RuntimeError, ValueError):
        return {}
    return {
        cell: [place for place in places if isinstance(place, str)]
        for cell, places in (data.items() if isinstance(data, dict) else ())
        if isinstance(places, list)
    }
