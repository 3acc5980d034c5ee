"""Errors in words."""

from __future__ import annotations

from basecal.errors import error_words


def test_an_error_is_a_line():
    """Line breaks of a library's words go; an error without words is told by its kind."""
    assert error_words(RuntimeError("Please\n  wait ")) == "Please wait"
    assert error_words(ValueError()) == "ValueError"
