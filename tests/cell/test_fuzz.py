"""Tests that damaged files give either a result or an InputError."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest

from basecal.cell.calibration import Calibration
from basecal.cell.files import read_calibration, read_cell, read_recording, write_calibration
from basecal.errors import InputError
from cell_example import CELL, LINES, journal
from quick import quick

_PIECES = (
    b"[",
    b"]",
    b"{",
    b"}",
    b":",
    b"-",
    b"\n",
    b'"',
    b",",
    b"1e999",
    b"NaN",
    b"\xff",
    b"\0",
    b"null",
    b"true",
    b"&a",
)


def damage(content: bytes, seed: int) -> bytes:
    """Content with up to four pieces cut, duplicated, swapped or replaced."""
    chance = random.Random(seed)
    data = bytearray(content)
    for _ in range(chance.randint(1, 4)):
        at, size = chance.randrange(len(data)), chance.randint(0, 6)
        piece = chance.choice([chance.choice(_PIECES), bytes([chance.randrange(256)]), bytes(data[at : at + 9]), b""])
        data[at : at + size] = piece
    return bytes(data)


def refusal(read: Callable[[], object]) -> str | None:
    """Return the message of an InputError, or None on success; other exceptions propagate."""
    try:
        read()
    except InputError as error:
        return str(error)
    return None


@pytest.mark.journey
@pytest.mark.parametrize("start", quick(range(0, 300, 50), (0, 50, 100)))
def test_damaged_cell_file_names_file(folder: Path, start: int) -> None:
    """A damaged cell.yaml either gives a cell or an InputError that names the file."""
    for seed in range(start, start + 50):
        (folder / "cell.yaml").write_bytes(damage(CELL.encode(), seed))
        message = refusal(lambda: read_cell(folder))
        assert message is None or "cell.yaml" in message, seed


@pytest.mark.journey
def test_damaged_samples_file_names_line(folder: Path) -> None:
    """A damaged samples.jsonl either gives a recording or an InputError that names the line."""
    cell, refused = read_cell(folder), 0
    for seed in range(300):
        (folder / "recording" / "samples.jsonl").write_bytes(damage(journal(*LINES), seed))
        message = refusal(lambda: read_recording(folder, cell))
        assert message is None or "samples.jsonl:" in message, seed
        refused += message is not None
    assert 150 < refused < 300


@pytest.mark.journey
def test_damaged_calibration_file_names_file(tmp_path: Path) -> None:
    """A damaged calibration.json either gives a calibration or an InputError that names the file."""
    path = write_calibration(Calibration("good"), tmp_path)
    content = path.read_bytes()
    for seed in range(300):
        path.write_bytes(damage(content, seed))
        message = refusal(lambda: read_calibration(path))
        assert message is None or "calibration.json" in message, seed
