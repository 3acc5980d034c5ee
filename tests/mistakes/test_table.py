"""Tests that each mistake is the first finding, with advice."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from mistakes.outcome import outcome
from mistakes.table import MISTAKES, UNREADABLE, USAGE, Mistake

# What is told at the door takes no time; what has to be fitted, or searched for in images, does.
QUICK = {UNREADABLE, USAGE, "length-unit", "angle-unit", "board-size", "too-few-samples", "intrinsics"}
# Searched for among what is rare; joints of one robot that are turned twice are among the quick ones.
LONG = {
    "roll, pitch and yaw in radians",
    "roll, pitch and yaw of all in radians",
    "all joints turned into radians twice",
}


def marked(mistake: Mistake) -> object:
    marks = () if mistake.code in QUICK and mistake.name not in LONG else (pytest.mark.slow,)
    return pytest.param(mistake, id=mistake.name, marks=marks)


def test_table_has_forty_distinct_mistakes() -> None:
    """The table has at least forty mistakes with unique names, including slow ones."""
    assert {mistake.name for mistake in MISTAKES} >= LONG
    assert len({mistake.name for mistake in MISTAKES}) == len(MISTAKES) >= 40


@pytest.mark.journey
@pytest.mark.parametrize("mistake", list(map(marked, MISTAKES)))
def test_mistake_is_the_first_finding_with_its_fix(
    mistake: Mistake, copied: Callable[[str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """The first sentence states the problem and the advice, and has the expected code.

    Duplicate rows are counted once and the answer is good: then the finding comes below.
    """
    folder = copied(mistake.cell)
    mistake.change(folder)
    found = outcome(mistake.words(folder), folder, capsys)
    assert found.code == mistake.code, found.text
    said = " ".join(found.text.split()) if found.verdict == "good" else found.first
    assert [words for words in mistake.says if words.lower() not in said.lower()] == []
    assert found.verdict != "good" or mistake.code in ("duplicate-samples", "dropped-sample")
