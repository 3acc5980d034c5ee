"""Each mistake is named first, with what to do."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from mistakes.outcome import outcome
from mistakes.table import MISTAKES, Mistake


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: mistake.name)
def test_it_is_named_with_its_fix(
    mistake: Mistake, copied: Callable[[str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """The first sentence says what is wrong and what to do, and has the expected code; no answer is called good."""
    folder = copied(mistake.cell)
    mistake.change(folder)
    found = outcome(mistake.words(folder), folder, capsys)
    assert found.code == mistake.code, found.text
    for words in mistake.says:
        assert words in found.first
