"""Tests of error messages."""

from __future__ import annotations

from basecal.errors import count_text, error_words


def test_error_message_is_one_line():
    """Line breaks of a library's message are removed; an error without a message is named by its type."""
    assert error_words(RuntimeError("Please\n  wait ")) == "Please wait"
    assert error_words(ValueError()) == "ValueError"


def test_count_of_one_is_singular() -> None:
    assert [count_text(count, "sample") for count in (0, 1, 2)] == ["0 samples", "1 sample", "2 samples"]
