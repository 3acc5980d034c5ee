"""What is said of a text that is no YAML."""

from __future__ import annotations

import pytest

from basecal.cell.format.yaml_text import parse_yaml
from basecal.errors import DatasetError


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("a:\n  b: 1\n\tc: 2\n", 3, "a tab sets this line in"),
        ("a:\n  b:1\n  c: 2\n", 2, "a space after the colon is missing"),
        ("a:1\nb: 2\n", 1, "a space after the colon is missing"),
        ("a: [1, 2\nb: 3\n", 1, "the bracket that opens here is not closed: add ]"),
        ("a: {b: 1\nc: 2\n", 1, "the bracket that opens here is not closed: add }"),
        ("a: 'x\nb: 1\n", 1, "the quote that opens here is not closed"),
        ("a:\n  b: 1\n c: 2\n", 3, "indented unlike those beside it"),
        ("a:\n  b: 1\n   c: 2\n", 3, "indented under a line that has its value already"),
        ("a: b: c\n", 1, "two colons"),
        ("on eye  # x: y\nb: 2\n", 1, "there is no colon"),
        ("a: @x\n", 1, "a value cannot start with '@'"),
        ("%YAM\n", 1, "it ends before anything is said: expected `key: value`"),
        ("a: }\n", 1, "a bracket } closes that nothing opened"),
        ("a:\n  b: {c: d}}\n", 2, "a bracket } closes that nothing opened"),
    ],
)
def test_slips_of_the_hand_have_their_line_and_fix(text: str, line: int, words: str) -> None:
    """Without the words of the parser, on the line where it is to be mended."""
    with pytest.raises(DatasetError) as caught:
        parse_yaml(text, "f")
    assert caught.value.line == line
    assert words in caught.value.reason
    assert "mapping" not in caught.value.reason
