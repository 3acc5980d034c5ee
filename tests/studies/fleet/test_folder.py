"""Cells found below a folder, and what tells that one has changed."""

from __future__ import annotations

import os

import pytest

from basecal.errors import InputError
from basecal.studies.fleet.folder import find_cells, fingerprint


def cell(folder, text="x"):
    (folder / "recording").mkdir(parents=True)
    (folder / "cell.yaml").write_text(text)
    (folder / "recording" / "samples.jsonl").write_text("{}\n")
    return folder


def test_cells_at_any_depth(tmp_path) -> None:
    """In their order, nothing inside of one, no hidden folder, no link; one that lacks its cell.yaml is among them."""
    cell(tmp_path / "b" / "two")
    cell(tmp_path / "a")
    cell(tmp_path / "a" / "inner")
    cell(tmp_path / ".hidden" / "c")
    (tmp_path / "bare" / "recording").mkdir(parents=True)
    (tmp_path / "notes").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "a")
    assert find_cells(tmp_path) == ("a", "b/two", "bare")


def test_no_cell_is_told(tmp_path) -> None:
    """Of a folder without any, and of a path that is no folder."""
    with pytest.raises(InputError, match="holds no cell"):
        find_cells(tmp_path)
    with pytest.raises(InputError, match="is no folder"):
        find_cells(tmp_path / "none")


def test_fingerprints_tell_changes(tmp_path) -> None:
    """Of any file but those that programs make of a cell, and of what the answer depends on besides."""
    folder = cell(tmp_path / "a")
    first = fingerprint(folder, "1")
    for made in ("runs", "derived"):
        (folder / made).mkdir()
        (folder / made / "x").write_text("x")
    assert fingerprint(folder, "1") == first
    assert fingerprint(folder, "2") != first
    samples = folder / "recording" / "samples.jsonl"
    os.utime(samples, ns=(0, samples.stat().st_mtime_ns + 1))
    assert fingerprint(folder, "1") != first
    changed = fingerprint(folder, "1")
    (folder / "recording" / "images").mkdir()
    (folder / "recording" / "images" / "derived").write_text("a file of such a name further down counts")
    assert fingerprint(folder, "1") != changed
