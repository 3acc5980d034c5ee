"""Everything wrong with a file, at once and in its order."""

from __future__ import annotations

import pytest

from basecal.fields.problems import Problem, dataset_error, field_name, line_number, shorten

LINES = {(): 1, ("a",): 2, ("a", "b"): 3, ("c",): 9}


@pytest.mark.parametrize(
    ("loc", "name"),
    [((), ""), (("a",), "a"), (("a", "b", 0, "c"), "a.b[0].c"), ((3,), "[3]"), (("a", 1, 2), "a[1][2]")],
)
def test_places_are_named_as_written(loc, name):
    """Keys by dots, indices in brackets."""
    assert field_name(loc) == name


def test_a_place_is_one_short_line():
    """Whatever a stranger's keys are: newlines are written out, and long keys end."""
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
def test_values_are_told_in_a_few_characters(value, text):
    """Whatever they are, up to sixty."""
    assert shorten(value) == text


def test_a_line_is_that_of_the_nearest_thing_around():
    """A place that is not written has the line of what it would stand in."""
    assert [line_number(loc, LINES) for loc in (("a", "b"), ("a", "x", 0), ("x",), ())] == [3, 2, 1, 1]
    assert line_number(("x",), {}) is None


def test_problems_are_told_once_in_the_order_of_the_file():
    """Each with path, line and field on a line of its own; the error is at the first."""
    told = [Problem(("c",), "last"), Problem(("a", "b"), "first"), Problem(("c",), "last")]
    error = dataset_error("cell.yaml", told, LINES)
    assert str(error) == "cell.yaml:3: a.b: first\ncell.yaml:9: c: last"
    assert (error.line, error.field) == (3, "a.b")
    assert str(dataset_error("cell.yaml", [Problem((), "empty")], {})) == "cell.yaml: empty"


def test_problems_without_a_line_come_first_and_all_on_one_line_by_field():
    """The order is that of lines, not of names; what stands nowhere in the file has no line and goes before."""
    lines = {("z",): 1, ("y",): 2, ("b",): 7, ("a",): 7}
    told = [Problem((name,), "bad") for name in ("y", "b", "nowhere", "z", "a")]
    assert str(dataset_error("c", told, lines)) == "c: nowhere: bad\nc:1: z: bad\nc:2: y: bad\nc:7: a: bad\nc:7: b: bad"
