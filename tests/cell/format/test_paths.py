"""Paths stay inside a cell, and files are written whole."""

from __future__ import annotations

import os

import pytest

from basecal.cell.format.paths import own_file, path_resolver
from basecal.errors import DatasetError, InputError


@pytest.mark.parametrize(
    ("written", "found"),
    [
        ("a.png", "rec/a.png"),
        ("./b/../a.png", "rec/a.png"),
        ("../a.png", "a.png"),
        ("..a", "rec/..a"),
        ("b/c", "rec/b/c"),
    ],
)
def test_paths_start_from_their_folder(tmp_path, written, found):
    """A path as written in `rec` becomes one from the cell, dots resolved."""
    assert path_resolver(str(tmp_path), "rec")(written) == found


@pytest.mark.parametrize(
    "written", ["", "/etc/passwd", "C:/x", "a\\b", "a\0b", "a\x1b[2J", "\ud800", "a\nb", "\u202egnp"]
)
def test_paths_are_relative_with_forward_slashes(tmp_path, written):
    """Absolute ones, drives, backslashes and nothing at all are refused."""
    with pytest.raises(InputError, match="is not a relative path with forward slashes"):
        path_resolver(str(tmp_path))(written)


@pytest.mark.parametrize("written", ["..", "../x", "a/../../x"])
def test_paths_do_not_leave_the_cell(tmp_path, written):
    """Not by dots."""
    with pytest.raises(InputError, match="leaves the cell; copy the file into it"):
        path_resolver(str(tmp_path))(written)


def test_links_do_not_leave_the_cell(tmp_path):
    """Not by a link to a file or a folder outside either; links inside are fine."""
    cell, outside = tmp_path / "cell", tmp_path / "outside"
    (cell / "images").mkdir(parents=True)
    outside.mkdir()
    (outside / "secret").write_text("x")
    (cell / "images" / "one.png").write_text("x")
    os.symlink(outside / "secret", cell / "images" / "file")
    os.symlink(outside, cell / "folder")
    os.symlink(cell / "images" / "one.png", cell / "same")
    path_in_cell = path_resolver(str(cell))
    for leaving in ("images/file", "folder", "folder/secret", "folder/new"):
        with pytest.raises(InputError, match="leaves the cell by a link"):
            path_in_cell(leaving)
    assert path_in_cell("same") == "same"
    assert path_in_cell("images/one.png") == "images/one.png"
    assert path_in_cell("not/there/yet") == "not/there/yet"


def test_own_files_are_no_links_out(tmp_path):
    """What a cell has at a place of its own may be a link inside it, and not one that leads out."""
    cell = tmp_path / "cell"
    cell.mkdir()
    (cell / "other.yaml").write_text("x")
    (cell / "cell.yaml").symlink_to("other.yaml")
    assert own_file(cell, "cell.yaml").read_text() == "x"
    (cell / "recording").symlink_to(tmp_path)
    with pytest.raises(DatasetError, match=r"samples\.jsonl: is a link that leads out of the cell"):
        own_file(cell, "recording/samples.jsonl")


def test_a_file_in_place_of_a_folder_is_said(tmp_path):
    """With what to give instead."""
    (tmp_path / "cell.yaml").write_text("x")
    with pytest.raises(
        DatasetError, match=r"cell\.yaml: is a file: give the folder of the cell, which holds cell\.yaml$"
    ):
        own_file(tmp_path / "cell.yaml", "cell.yaml")


@pytest.mark.parametrize("written", ["a" * 256, "ä" * 128 + "/b.png", "a/" * 501 + "b"])
def test_names_longer_than_any_file_has(tmp_path, written):
    """A name that no file system takes is refused before it is asked for, and not written out in full."""
    with pytest.raises(InputError, match=r"is longer than|has more than") as told:
        path_resolver(str(tmp_path))(written)
    assert len(str(told.value)) < 200
