"""Every importer is typed, and those that are public names are those that import."""

from __future__ import annotations

import inspect
from pathlib import Path

import pytest

import basecal
from basecal.exchange.importers.registry import IMPORTERS
from basecal.exchange.importing.imported import Imported


def test_public_names_are_importers() -> None:
    """What `basecal` offers of this folder are the functions of the table."""
    public = {getattr(basecal, name) for name, home in basecal._HOME.items() if home.startswith("exchange.importers.")}
    assert public <= set(IMPORTERS.values())
    assert basecal.read_poses in public


@pytest.mark.parametrize("kind", IMPORTERS)
def test_every_importer_is_typed(kind: str) -> None:
    """Cell and source come first, all else has a name and a type."""
    signature = inspect.signature(IMPORTERS[kind], eval_str=True)
    cell, source, *options = signature.parameters.values()
    assert {cell.kind, source.kind} == {inspect.Parameter.POSITIONAL_ONLY}
    assert {option.kind for option in options} == {inspect.Parameter.KEYWORD_ONLY}
    assert inspect.Parameter.empty not in {each.annotation for each in signature.parameters.values()}
    assert signature.return_annotation is Imported


def test_every_module_is_registered() -> None:
    """Each module of the folder has an importer that a line of the table names."""
    folder = Path(inspect.getfile(IMPORTERS["poses"])).parent
    modules = {path.stem for path in folder.glob("*.py")} - {"__init__", "registry"}
    unlisted = modules - {read.__module__.rpartition(".")[2] for read in IMPORTERS.values()}
    assert not unlisted, f"add to IMPORTERS of importers/registry.py: {sorted(unlisted)}"
