"""Tests of the report of all problems of a file, in the order of the file."""

from __future__ import annotations

import pytest

from basecal.fields.problems import Problem, dataset_error, field_name, line_number, shorten

LINES = {(): 1, ("a",): 2, ("a", "b"): 3, ("c",): 9}


@pytest.mark.parametrize(
    ("loc", "name"),
    [((), ""), (("a",), "a"), (("a", "b", 0, "c"), "a.b[0].c"), ((3,), "[3]"), (("a", 1, 2), "a[1][2]")],
)
def test_field_names_use_dots_and_brackets(loc, name):
    """Keys are joined by dots and indices are in brackets."""
    assert field_name(loc) == name


def test_field_name_is_one_short_line():
    """Field names of foreign keys stay on one line: newlines are escaped and long keys are shortened."""
    assert field_name(("a\nb", 3)) == "a\\nb[3]"
    assert field_name(("x" * 100, "x" * 101)) == f"{'x' * 100}.{'x' * 100}..."


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ({"a": 1}, "a mapping"),
        ([1, 2], "a list of 2"),
        (2**64, "a huge integer"),
        (2**63, str(2**63)),
        ("x" * 58, repr("x" * 58)),
        ("x" * 59, "'" + "x" * 59 + "..."),
        (None, "None"),
    ],
)
def test_values_are_shortened_to_sixty_characters(value, text):
    """Any value is printed in at most sixty characters."""
    assert shorten(value) == text


def test_line_number_of_missing_field_is_parents():
    """A field that is not written has the line of its nearest enclosing entry."""
    assert [line_number(loc, LINES) for loc in (("a", "b"), ("a", "x", 0), ("x",), ())] == [3, 2, 1, 1]
    assert line_number(("x",), {}) is None


def test_problems_are_reported_once_in_file_order():
    """Each problem is one line with path, line and field; the error's own line and field are the first problem's."""
    problems = [Problem(("c",), "last"), Problem(("a", "b"), "first"), Problem(("c",), "last")]
    error = dataset_error("cell.yaml", problems, LINES)
    assert str(error) == "cell.yaml:3: a.b: first\ncell.yaml:9: c: last"
    assert (error.line, error.field) == (3, "a.b")
    assert str(dataset_error("cell.yaml", [Problem((), "empty")], {})) == "cell.yaml: empty"


def test_problems_without_line_come_first():
    """Problems are sorted by line, then by field on one line; problems without a line precede them."""
    lines = {("z",): 1, ("y",): 2, ("b",): 7, ("a",): 7}
    problems = [Problem((name,), "bad") for name in ("y", "b", "nowhere", "z", "a")]
    assert (
        str(dataset_error("c", problems, lines))
        == "c: nowhere: bad\nc:1: z: bad\nc:2: y: bad\nc:7: a: bad\nc:7: b: bad"
    )
