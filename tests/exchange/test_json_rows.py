"""JSON lists of poses as rows."""

from __future__ import annotations

import json

import pytest

from basecal.exchange.json_rows import json_rows


@pytest.mark.parametrize(
    ("data", "rows"),
    [
        ([[1, 2.5], [3, 4]], ["1,2.5", "3,4"]),
        ([[[1, 2], [3, 4]]], ["1,2,3,4"]),
        ([{"x": 1, "y": 2}, {"x": 3, "y": 4}], ["x,y", "1,2", "3,4"]),
        ([{"x": 1, "y": 2}, {"y": 4, "x": 3}], ["x,y", "1,2", "3,4"]),
        ({"poses": [{"p": {"x": 1}, "q": {"w": 2}}]}, ["p.x,q.w", "1,2"]),
    ],
)
def test_a_row_for_each_record(data: object, rows: list[str]) -> None:
    """Numbers in order; those of objects under their names, however they are indented."""
    assert json_rows(json.dumps(data)).splitlines() == rows
    assert json_rows(json.dumps(data, indent=2)).splitlines() == rows


@pytest.mark.parametrize("text", ["x,y\n1,2\n", "[1, 2], [3, 4]", "[1, 2]", "[[1, 2], [3]]", '{"a": 1}', "[" * 9999])
def test_other_texts_are_none(text: str) -> None:
    """Tables, lists of numbers, records that differ, and what is no JSON."""
    assert json_rows(text) == ""


@pytest.mark.parametrize(("data", "rows"), [
    ({"poses": [[1, 2]], "count": 1}, "1,2\n"),
    ({"poses": [[1, 2]], "times": [3]}, ""),
    ([{"a": [{"b": 1}, 2]}], "a.0.b,a.1\n1,2\n"),
    ([{"a": "x, y", "b": None}], 'a,b\n"x, y",\n'),
    ([[], []], ""), ([{}], ""), ([], ""), ([[1], {"a": 1}], ""), ([{"a": 1}, {"b": 1}], ""), (3, ""),
])  # fmt: skip
def test_one_list_of_records_alike(data: object, rows: str) -> None:
    """Of an object with a single list, of any depth, with text in quotes; empty records are none."""
    assert json_rows(json.dumps(data)) == rows
    assert json_rows(f"\n  {json.dumps(data)}") == rows
