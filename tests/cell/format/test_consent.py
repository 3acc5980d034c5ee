"""What a cell may reach is remembered for this user, and a damaged memory allows nothing."""

from __future__ import annotations

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
