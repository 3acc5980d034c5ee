"""Tests that every importer is typed and public names are registered importers."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import basecal
from basecal.cell.files import read_cell
from basecal.cli import main
from basecal.errors import InputError
from basecal.exchange.importers.registry import IMPORTERS
from basecal.exchange.importing.imported import Imported


def test_public_names_are_registered_importers() -> None:
    """The functions that `basecal` exports from this folder are those of the table."""
    public = {getattr(basecal, name) for name, home in basecal._HOME.items() if home.startswith("exchange.importers.")}
    assert public <= set(IMPORTERS.values())
    assert basecal.read_poses in public


@pytest.mark.parametrize("kind", IMPORTERS)
def test_importer_signatures_are_typed(kind: str) -> None:
    """Cell and source come first; all other parameters have a name and a type."""
    signature = inspect.signature(IMPORTERS[kind], eval_str=True)
    cell, source, *options = signature.parameters.values()
    assert {cell.kind, source.kind} == {inspect.Parameter.POSITIONAL_ONLY}
    assert {option.kind for option in options} == {inspect.Parameter.KEYWORD_ONLY}
    assert inspect.Parameter.empty not in {each.annotation for each in signature.parameters.values()}
    assert signature.return_annotation is Imported


def test_every_importer_module_is_registered() -> None:
    """Each module of the folder has an importer in the table."""
    folder = Path(inspect.getfile(IMPORTERS["poses"])).parent
    modules = {path.stem for path in folder.glob("*.py")} - {"__init__", "registry"}
    unlisted = modules - {read.__module__.rpartition(".")[2] for read in IMPORTERS.values()}
    assert not unlisted, f"add to IMPORTERS of importers/registry.py: {sorted(unlisted)}"


def test_options_from_python_are_checked(tmp_path: Path) -> None:
    """An invalid value is an error that lists the choices, as on the command line."""
    (tmp_path / "photos").mkdir()
    photos = partial(basecal.read_images, tmp_path / "c", tmp_path / "photos", camera="cam", on="arm")
    tables = partial(basecal.read_poses, tmp_path / "c", tmp_path / "a.csv", robot="arm", format="ur")
    np.savez(tmp_path / "a.npz", R_gripper2base=[[0.0] * 3], t_gripper2base=[[0.0] * 3])
    calls: list[tuple[Callable[[], object], str]] = [
        (partial(basecal.read_array_file, tmp_path / "c", tmp_path / "a.npz", unit="metre"), "one of m, mm, inch"),
        (partial(tables, length_unit="metre"), "'metre': expected one of m, mm, inch"),
        (partial(photos, by="foo"), "by 'foo': expected one of order, name, time"),
        (partial(photos, target="foo", target_on="arm"), "target 'foo': expected one of charuco"),
        (partial(photos, target="charuco", shape=None), "expected a basecal.Shape"),
        (partial(photos, target="charuco", shape=basecal.Shape(squares=(5, 7))), "expected columns and rows"),
        (partial(basecal.import_into, tmp_path / "c", None), "expected what an importer read"),
    ]
    (tmp_path / "photos" / "1.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    for call, message in calls:
        with pytest.raises(InputError, match=message):
            call()


def test_format_names_ignore_case(tmp_path: Path) -> None:
    """The case of a maker's name does not matter."""
    (tmp_path / "a.txt").write_text("{X 100,Y 400,Z 655,A 12.4,B 3.1,C 178.2}\n")
    words = ["import", "poses", str(tmp_path / "c"), str(tmp_path / "a.txt"), "--robot", "r", "--format", "KUKA"]
    assert main(words) == 0
    assert read_cell(tmp_path / "c").robots["r"].controller == {"format": "kuka"}
