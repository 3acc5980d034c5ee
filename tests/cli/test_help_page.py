"""Pages of `--help`."""

from __future__ import annotations

from io import StringIO
from itertools import pairwise

import pytest
from rich.console import Console

from basecal.cli import build_app

VERBS = ["capture", "plan", "calibrate", "verify", "simulate", "study", "import poses"]


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("width", [40, 80, 120])
def test_paragraphs_fill_the_width(verb: str, width: int) -> None:
    """A line ends only where the next word does not fit, at the end of a paragraph, or in an example."""
    text, words = StringIO(), verb.split()
    build_app(words).help_print(words, console=Console(file=text, width=width, no_color=True, highlight=False))
    page = text.getvalue()
    about = page[page.index("\n\n") : page.index("╭")].split("For example:")[0]
    for paragraph in filter(None, about.strip().split("\n\n")):
        lines = [line.rstrip() for line in paragraph.strip("\n").split("\n")]
        for line, following in pairwise(lines):
            assert len(line) + 1 + len(following.split()[0]) > width, line


def test_help_of_an_option_is_one_paragraph() -> None:
    """Its lines in the source are no lines of the page."""
    text = StringIO()
    build_app(["capture"]).help_print(["capture"], console=Console(file=text, width=300, no_color=True))
    assert "With --tolerance its samples are candidates" in text.getvalue()


def test_examples_keep_their_lines() -> None:
    """Also if one is shorter than the width."""
    text = StringIO()
    build_app(["verify"]).help_print(["verify"], console=Console(file=text, width=120, no_color=True))
    lines = text.getvalue().splitlines()
    start = lines.index("    basecal verify mycell today.jsonl")
    assert lines[start + 1] == "    basecal verify mycell today"
