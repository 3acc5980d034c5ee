"""Tests of placing files into a cell, all or none."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from basecal.errors import InputError
from basecal.exchange.importing.cell_files import place_files, scratch_folder


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "a.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n")
    return path


def test_symlinked_source_is_resolved(tmp_path: Path, source: Path) -> None:
    """The file behind the link is linked; the link itself would lead out of the cell, which no reader follows."""
    (tmp_path / "named.png").symlink_to(source)
    with place_files({"recording/images/cam/a.png": tmp_path / "named.png"}, tmp_path / "cell", True):
        there = tmp_path / "cell" / "recording" / "images" / "cam" / "a.png"
    assert os.path.samefile(there, source)
    assert not there.is_symlink()


@pytest.mark.parametrize("link", [False, True])
def test_files_are_copied_or_hard_linked(tmp_path: Path, source: Path, link: bool) -> None:
    """A file is in the cell, as the same file if linked; repeating it changes no files."""
    for _ in range(2):
        with place_files({"recording/images/cam/a.png": source}, tmp_path / "cell", link):
            pass
    there = tmp_path / "cell" / "recording" / "images" / "cam" / "a.png"
    assert there.read_bytes() == b"\x89PNG\r\n\x1a\n"
    assert os.path.samefile(there, source) == link


def test_failure_removes_placed_files(tmp_path: Path, source: Path) -> None:
    """If a later step fails, new files and folders are removed, and others are kept."""
    (tmp_path / "cell").mkdir()
    with pytest.raises(ValueError, match="later"), place_files({"x/y/a.png": source}, tmp_path / "cell"):
        raise ValueError("later")
    assert list((tmp_path / "cell").iterdir()) == []
    with pytest.raises(ValueError, match="later"), place_files({"x/a.png": source}, tmp_path / "new"):
        raise ValueError("later")
    assert not (tmp_path / "new").exists()


def test_different_file_is_not_overwritten(tmp_path: Path, source: Path) -> None:
    """A file with other bytes is kept and reported."""
    (tmp_path / "cell").mkdir()
    (tmp_path / "cell" / "a.png").write_bytes(b"older")
    with pytest.raises(InputError, match="exists and differs"), place_files({"a.png": source}, tmp_path / "cell"):
        pass
    assert (tmp_path / "cell" / "a.png").read_bytes() == b"older"


def test_files_outside_cell_are_refused(tmp_path: Path, source: Path) -> None:
    """Neither a path nor a link may lead out of the cell."""
    (tmp_path / "cell").mkdir()
    (tmp_path / "cell" / "out").symlink_to(tmp_path)
    for name in ("../b.png", "out/b.png"):
        with pytest.raises(InputError, match="leaves the cell"), place_files({name: source}, tmp_path / "cell"):
            pass
    assert not (tmp_path / "b.png").exists()


def test_scratch_folder_is_removed_on_failure(tmp_path: Path) -> None:
    """It is beside the cell, which need not exist, and otherwise stays until its owner cleans it up."""
    with pytest.raises(ValueError, match="later"), scratch_folder(tmp_path / "new" / "cell"):
        raise ValueError("later")
    assert list(tmp_path.iterdir()) == []
    with scratch_folder(tmp_path / "cell") as scratch:
        assert Path(scratch.name).parent == tmp_path
    assert Path(scratch.name).is_dir()
    scratch.cleanup()
