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
