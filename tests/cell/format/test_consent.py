"""Tests of the user's stored consents for cells: a damaged store permits no access."""

from __future__ import annotations

import json
import os

import pytest

from basecal.cell.format.consent import allow, is_allowed, withdraw


@pytest.fixture
def memory(tmp_path, monkeypatch):
    """Path of the file that stores consents."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "basecal" / "allowed.json"


def test_consent_applies_to_one_cell(memory, tmp_path):
    """A consent applies to the real path of one cell until it is withdrawn; only its owner can read the file."""
    (tmp_path / "link").symlink_to(tmp_path / "cell")
    allow(tmp_path / "cell", ["a", "b"])
    assert is_allowed(tmp_path / "link", "a")
    assert not is_allowed(tmp_path / "cell", "c")
    assert not is_allowed(tmp_path / "other", "a")
    withdraw(tmp_path / "cell", "a")
    assert [is_allowed(tmp_path / "cell", place) for place in "ab"] == [False, True]
    assert memory.stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("text", ["", "[]", "null", '{"x": 1}', "{", "[[1]]"])
def test_damaged_consent_file_allows_no_access(memory, tmp_path, text):
    """Access requires a new consent if the file is damaged, and the file is rewritten."""
    memory.parent.mkdir(parents=True)
    memory.write_text(text)
    assert not is_allowed(tmp_path, "a")
    allow(tmp_path, ["a"])
    assert is_allowed(tmp_path, "a")


def test_unwritable_consent_file_is_no_error(tmp_path, monkeypatch):
    """The user has to consent each time if consents cannot be stored."""
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_STATE_HOME", os.fspath(tmp_path / "file"))
    allow(tmp_path, ["a"])
    assert not is_allowed(tmp_path, "a")


@pytest.mark.parametrize("variable", [None, ""])
def test_consent_file_is_in_home_folder(tmp_path, monkeypatch, variable):
    """Without XDG_STATE_HOME, consents are stored in the usual state folder of the user's home."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_STATE_HOME", raising=False)
    if variable is not None:
        monkeypatch.setenv("XDG_STATE_HOME", variable)
    allow(tmp_path / "cell", ["a"])
    assert (tmp_path / ".local" / "state" / "basecal" / "allowed.json").is_file()
    assert is_allowed(tmp_path / "cell", "a")


def test_withdrawing_last_consent_removes_cell(memory, tmp_path):
    """Consents of other cells and for other places of one cell are kept; malformed entries are dropped."""
    allow(tmp_path / "one", ["b", "a"])
    allow(tmp_path / "two", ["a"])
    allow(tmp_path / "one", ["a", "c"])
    one, two = (os.path.realpath(tmp_path / name) for name in ("one", "two"))
    assert json.loads(memory.read_text()) == {one: ["a", "b", "c"], two: ["a"]}
    withdraw(tmp_path / "two", "a")
    withdraw(tmp_path / "two", "a")
    assert json.loads(memory.read_text()) == {one: ["a", "b", "c"]}
    memory.write_text(json.dumps({one: ["a", 3], two: "a"}))
    assert is_allowed(tmp_path / "one", "a")
    assert not is_allowed(tmp_path / "two", "a")
