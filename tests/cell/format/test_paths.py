"""Tests that paths stay inside a cell."""

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
def test_paths_are_resolved_from_their_folder(tmp_path, written, found):
    """A path written in `rec` becomes one from the cell, with dots resolved."""
    assert path_resolver(str(tmp_path), "rec")(written) == found


@pytest.mark.parametrize(
    "written", ["", "/etc/passwd", "C:/x", "a\\b", "a\0b", "a\x1b[2J", "\ud800", "a\nb", "\u202egnp"]
)
def test_absolute_and_malformed_paths_are_refused(tmp_path, written):
    """Absolute paths, drives, backslashes, control characters and empty paths are refused."""
    with pytest.raises(InputError, match="is not a relative path with forward slashes"):
        path_resolver(str(tmp_path))(written)


@pytest.mark.parametrize("written", ["..", "../x", "a/../../x"])
def test_parent_paths_out_of_cell_are_refused(tmp_path, written):
    """A path must not leave the cell by `..`."""
    with pytest.raises(InputError, match="leaves the cell; copy the file into it"):
        path_resolver(str(tmp_path))(written)


def test_links_out_of_cell_are_refused(tmp_path):
    """A path must not leave the cell by a link to a file or folder outside; links inside are accepted."""
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


def test_own_file_refuses_links_out_of_cell(tmp_path):
    """A file of the cell may be a link inside it, but not one that leads out."""
    cell = tmp_path / "cell"
    cell.mkdir()
    (cell / "other.yaml").write_text("x")
    (cell / "cell.yaml").symlink_to("other.yaml")
    assert own_file(cell, "cell.yaml").read_text() == "x"
    (cell / "recording").symlink_to(tmp_path)
    with pytest.raises(DatasetError, match=r"samples\.jsonl: is a link that leads out of the cell"):
        own_file(cell, "recording/samples.jsonl")


def test_file_in_place_of_folder_is_refused(tmp_path):
    """The error for a file in place of a cell's folder states what to give instead."""
    (tmp_path / "cell.yaml").write_text("x")
    with pytest.raises(
        DatasetError, match=r"cell\.yaml: is a file: give the folder of the cell, which holds cell\.yaml$"
    ):
        own_file(tmp_path / "cell.yaml", "cell.yaml")


@pytest.mark.parametrize("written", ["a" * 256, "ä" * 128 + "/b.png", "a/" * 501 + "b"])
def test_overlong_paths_are_refused(tmp_path, written):
    """A name longer than any file system allows is refused before access, and is shortened in the error."""
    with pytest.raises(InputError, match=r"is longer than|has more than") as caught:
        path_resolver(str(tmp_path))(written)
    assert len(str(caught.value)) < 200
