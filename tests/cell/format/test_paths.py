"""Paths stay inside a cell, and files are written whole."""

from __future__ import annotations

import os

import pytest

from basecal.cell.format.paths import inside, write_whole
from basecal.errors import InputError


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
    assert inside(str(tmp_path), "rec")(written) == found


@pytest.mark.parametrize(
    "written", ["", "/etc/passwd", "C:/x", "a\\b", "a\0b", "a\x1b[2J", "\ud800", "a\nb", "\u202egnp"]
)
def test_paths_are_relative_with_forward_slashes(tmp_path, written):
    """Absolute ones, drives, backslashes and nothing at all are refused."""
    with pytest.raises(InputError, match="is not a relative path with forward slashes"):
        inside(str(tmp_path))(written)


@pytest.mark.parametrize("written", ["..", "../x", "a/../../x"])
def test_paths_do_not_leave_the_cell(tmp_path, written):
    """Not by dots."""
    with pytest.raises(InputError, match="leaves the cell; copy the file into it"):
        inside(str(tmp_path))(written)


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
    path_in_cell = inside(str(cell))
    for leaving in ("images/file", "folder", "folder/secret", "folder/new"):
        with pytest.raises(InputError, match="leaves the cell by a link"):
            path_in_cell(leaving)
    assert path_in_cell("same") == "same"
    assert path_in_cell("images/one.png") == "images/one.png"
    assert path_in_cell("not/there/yet") == "not/there/yet"


def test_a_file_is_written_whole(tmp_path):
    """The text, in folders made for it, nothing beside it; where that cannot be, an error with the path."""
    path = tmp_path / "runs" / "one" / "a.json"
    write_whole(path, "grün")
    write_whole(path, "blue")
    assert path.read_bytes() == b"blue"
    assert [each.name for each in path.parent.iterdir()] == ["a.json"]
    with pytest.raises(InputError, match=r"a\.json/b cannot be written: "):
        write_whole(path / "b", "x")
