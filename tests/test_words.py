"""Names and sentences get no worse: see `tests/words.py`, whose command lists them."""

from __future__ import annotations

import pytest

from tests.words import Name, complaints, docstrings, documents, fault, messages, names, sentences, word_count

NAME_FAULTS, SENTENCE_FAULTS, DOCUMENT_FAULTS = 2, 210, 0  # ceilings, to be lowered with every room that is renamed


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("function", "told"),
        ("function", "_moved"),
        ("function", "at_task"),
        ("function", "left_out"),
        ("function", "are_alike"),
        ("parameter", "what"),
        ("parameter", "found"),
        ("constant", "_ROUNDS"),
        ("module", "at_the_door"),
    ],
)
def test_names_that_say_nothing_are_found(kind: str, name: str) -> None:
    """A participle, a preposition, a replaced word and a constant that counts nothing are each found."""
    assert fault(Name(kind, "", 1, name))


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("function", "estimate_noise"),
        ("function", "is_moved"),
        ("function", "with_noise"),
        ("function", "eye_base_from_hand_base"),
        ("function", "speed"),
        ("parameter", "problem"),
        ("constant", "_FIT_ROUNDS"),
        ("module", "residuals"),
    ],
)
def test_names_that_say_something_pass(kind: str, name: str) -> None:
    """A verb with its object, a noun, a question and a transform are no faults."""
    assert fault(Name(kind, "", 1, name)) == ""


def test_sentences_are_counted_by_their_words() -> None:
    """A value that is filled in is one word, and code is one."""
    assert [word_count(each) for each in sentences("*One `two three` four.* Five: six")] == [3, 1, 1]


def test_names_get_no_worse() -> None:
    """Names at fault stay below a ceiling, to be lowered with every room that is renamed."""
    found = {(name.kind, name.path, name.name) for name in names() if fault(name)}
    assert len(found) <= NAME_FAULTS


def test_sentences_get_no_worse() -> None:
    """Sentences that are too long or hold a replaced word stay below a ceiling, to be lowered likewise."""
    assert len(list(complaints(iter([*docstrings(), *messages()])))) <= SENTENCE_FAULTS
    assert len(list(complaints(documents()))) <= DOCUMENT_FAULTS
