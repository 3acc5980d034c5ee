"""JSON as people read it."""

from __future__ import annotations

import json

import pytest

from basecal.cell.format.json_text import indent_json

DATA = {"a": [[1.0, 2.5e-7], [None, True]], "b": {"c": {}, "d": '"x" \u00e9'}, "e": [], "f": {"g": 1, "h": "y"}}


def test_it_is_the_data():
    """To the last digit, as `json.loads` has it."""
    assert json.loads(indent_json(DATA)) == DATA


def test_rows_are_lines():
    """What holds no list or mapping is not broken."""
    assert indent_json(DATA).split("\n") == [
        "{",
        ' "a": [',
        "  [1.0, 2.5e-07],",
        "  [null, true]",
        " ],",
        ' "b": {',
        '  "c": {},',
        '  "d": "\\"x\\" \\u00e9"',
        " },",
        ' "e": [],',
        ' "f": {"g": 1, "h": "y"}',
        "}",
    ]


def test_what_is_not_finite_is_refused():
    """No reader would have it."""
    with pytest.raises(ValueError, match="not JSON compliant"):
        indent_json({"a": [float("nan")]})
