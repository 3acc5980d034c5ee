"""What a cell may reach is remembered for this user, and a damaged memory allows nothing."""

from __future__ import annotations

import json
import os

import pytest

from basecal.cell.format.consent import allow, is_allowed, withdraw


@pytest.fixture
def memory(tmp_path, monkeypatch):
    """The file in which it is remembered."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "basecal" / "allowed.json"


def test_a_place_is_allowed_to_one_cell(memory, tmp_path):
    """By the folder's real path, until it is withdrawn; only its owner can read the file."""
    (tmp_path / "link").symlink_to(tmp_path / "cell")
    allow(tmp_path / "cell", ["a", "b"])
    assert is_allowed(tmp_path / "link", "a")
    assert not is_allowed(tmp_path / "cell", "c")
    assert not is_allowed(tmp_path / "other", "a")
    withdraw(tmp_path / "cell", "a")
    assert [is_allowed(tmp_path / "cell", place) for place in "ab"] == [False, True]
    assert memory.stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("text", ["", "[]", "null", '{"x": 1}', "{", "[[1]]"])
def test_a_damaged_memory_allows_nothing(memory, tmp_path, text):
    """It is asked again, and written anew."""
    memory.parent.mkdir(parents=True)
    memory.write_text(text)
    assert not is_allowed(tmp_path, "a")
    allow(tmp_path, ["a"])
    assert is_allowed(tmp_path, "a")


def test_without_a_place_to_remember_it_is_asked_again(tmp_path, monkeypatch):
    """A memory that cannot be written is no error."""
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_STATE_HOME", os.fspath(tmp_path / "file"))
    allow(tmp_path, ["a"])
    assert not is_allowed(tmp_path, "a")


@pytest.mark.parametrize("variable", [None, ""])
def test_it_is_remembered_in_the_home_folder(tmp_path, monkeypatch, variable):
    """In the usual place for states of programs, where the environment names no other."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_STATE_HOME", raising=False)
    if variable is not None:
        monkeypatch.setenv("XDG_STATE_HOME", variable)
    allow(tmp_path / "cell", ["a"])
    assert (tmp_path / ".local" / "state" / "basecal" / "allowed.json").is_file()
    assert is_allowed(tmp_path / "cell", "a")


def test_what_is_withdrawn_last_leaves_no_cell(memory, tmp_path):
    """Other cells, and other places of one cell, stay; odd entries are dropped."""
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
