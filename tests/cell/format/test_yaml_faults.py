"""What is said of a text that is no YAML."""

from __future__ import annotations

import pytest
from ruamel.yaml.error import MarkedYAMLError, StringMark

from basecal.cell.format.yaml_faults import yaml_fault
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


@pytest.mark.parametrize(
    ("context", "problem", "reason"),
    [
        ("while reading\n  a node", None, "while reading a node"),
        ("while reading", "found  an odd\n thing", "found an odd thing"),
        (None, "mapping values are not allowed here", "mapping values are not allowed here"),
        ("while scanning a quoted scalar", "found unexpected end of stream", "found unexpected end of stream"),
        (None, "expected ',' or ']', but got it", "expected ',' or ']', but got it"),
        (None, "but found ']'", "a bracket ] closes that nothing opened: remove it"),
        (None, "found character '@' that cannot start any token", "a value cannot start with '@': put it into quotes"),
    ],
)
def test_faults_without_a_place_are_told_in_the_parsers_words(context, problem, reason):
    """In one line; what it is most often for needs no place where the words alone say it."""
    assert yaml_fault("a: 1\n", MarkedYAMLError(context, None, problem, None)) == (reason, None)


def test_a_fault_is_on_the_line_of_its_mark():
    """Counted from 1, that of what was opened where it was not closed."""
    begun, mark = (StringMark("x", 0, line, 3, "", 0) for line in (1, 4))
    found = yaml_fault("a: [1\n" * 6, MarkedYAMLError("while parsing", begun, "expected ',' or ']', but got x", mark))
    assert found == ("the bracket that opens here is not closed: add ]", 2)
    found = yaml_fault("a: 'x\n" * 6, MarkedYAMLError("while scanning a quoted scalar", begun, "found end", mark))
    assert found == ("the quote that opens here is not closed: add another", 2)
    found = yaml_fault("a: 1\n" * 6, MarkedYAMLError(None, None, "something else", mark))
    assert found == ("something else", 5)
    tab = yaml_fault("a: 1\n  \tb: 2\n\tc: 3\n", MarkedYAMLError(None, None, "something else", mark))
    assert tab == ("a tab sets this line in, which YAML does not allow: replace it by spaces", 2)
