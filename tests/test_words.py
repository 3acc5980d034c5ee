"""Tests of names and sentences of the project: the command of `tests/words.py` lists the faults."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from tests.words import (
    Name,
    Text,
    complaints,
    docstrings,
    documents,
    fault,
    messages,
    names,
    names_of_tests,
    sentences,
    word_count,
)


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
        ("test", "test_a_missing_file_is_told"),
    ],
)
def test_vague_names_are_found(kind: str, name: str) -> None:
    """A participle, a preposition, a replaced word and a constant without a count are found."""
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
def test_clear_names_pass(kind: str, name: str) -> None:
    """A verb with its object, a noun, a question and a transform are no faults."""
    assert fault(Name(kind, "", 1, name)) == ""


def test_words_of_sentences_are_counted() -> None:
    """An inserted value counts as one word, and so does code."""
    assert [word_count(each) for each in sentences("*One `two three` four.* Five: six")] == [3, 2]


@pytest.mark.parametrize("first", ["What a stage found.", "Of each view: its cost.", "So many rotations."])
def test_docstrings_with_a_leading_clause_are_found(first: str) -> None:
    """Docstrings begin with a noun or a verb, as in `Result of a stage`; other texts are free."""
    assert [why for _, why, _ in complaints(iter([Text("docstring", "", 1, first)]))]
    assert not list(complaints(iter([Text("docstring", "", 1, "Result of a stage.")])))
    assert not list(complaints(iter([Text("document", "", 1, first)])))


@pytest.mark.parametrize(
    ("sentence", "complaint"),
    [
        ("A joint errs.", "for `errs` write has an error, is off"),
        ("They Mended it.", "for `Mended` write fix"),
        ("It is a state that cannot be.", "for `that cannot be` write implausible"),
        ("A word " * 11 + "more.", "23 words, at most 20"),
    ],
)
def test_complaint_has_the_replacement(sentence: str, complaint: str) -> None:
    """A complaint has the phrase with its replacement, or the number of allowed words."""
    assert [why for _, why, _ in complaints(iter([Text("message", "", 1, sentence)]))] == [complaint]


def test_names_have_no_faults() -> None:
    """Each name of the package passes, and each name of a test."""
    every = (*names(), *names_of_tests())
    faults = [f"{name.path}:{name.line}: {name.kind} {name.name}: {fault(name)}" for name in every if fault(name)]
    assert not faults, f"rename these, by the rules in tests/words.py: {'; '.join(faults)}"


@pytest.mark.parametrize("texts", [docstrings, messages, documents])
def test_sentences_have_no_faults(texts: Callable[[], Iterator[Text]]) -> None:
    """No sentence is too long or has a replaced word."""
    faults = [f"{text.path}:{text.line}: {why}: {sentence}" for text, why, sentence in complaints(texts())]
    assert not faults, "\n".join(["write these anew, in shorter or other words:", *faults])
