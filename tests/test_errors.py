"""Errors in words."""

from __future__ import annotations

from basecal.errors import count_text, error_words


def test_an_error_is_a_line():
    """Line breaks of a library's words go; an error without words is told by its kind."""
    assert error_words(RuntimeError("Please\n  wait ")) == "Please wait"
    assert error_words(ValueError()) == "ValueError"


def test_a_single_thing_has_no_plural() -> None:
    assert [count_text(count, "sample") for count in (0, 1, 2)] == ["0 samples", "1 sample", "2 samples"]
