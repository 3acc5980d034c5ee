"""Fixtures of correct cells, made once."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from shutil import copytree

import pytest

from mistakes.cells import CELLS


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Folder of a correct cell, which no test changes."""
    folders: dict[str, Path] = {}

    def of(kind: str) -> Path:
        if kind not in folders:
            folders[kind] = tmp_path_factory.mktemp("cells") / kind.replace(" ", "_")
            folders[kind].mkdir()
            CELLS[kind](folders[kind])
        return folders[kind]

    return of


@pytest.fixture
def copied(made: Callable[[str], Path], tmp_path: Path) -> Callable[[str], Path]:
    """Copy of a correct cell, to which a test applies a mistake."""
    return lambda kind: copytree(made(kind), tmp_path / "cell")
