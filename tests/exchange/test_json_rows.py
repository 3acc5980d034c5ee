"""Tests of JSON poses read as rows."""

from __future__ import annotations

import json

import pytest

from basecal.errors import DatasetError
from basecal.exchange import json_rows as module
from basecal.exchange.json_rows import json_records, json_rows

Records = list[tuple[int, dict[str, str]]]


@pytest.mark.parametrize(
    ("data", "rows"),
    [
        ([[1, 2.5], [3, 4]], "1,2.5\n3,4\n"),
        ([[[1, 2], [3, 4]]], "1,2,3,4\n"),
        ({"poses": [[1, 2]], "count": 1}, "1,2\n"),
    ],
)
def test_each_list_becomes_row(data: object, rows: str) -> None:
    """Numbers keep their order, however the JSON is indented."""
    assert json_rows(json.dumps(data)) == json_rows(json.dumps(data, indent=2)) == rows
    assert json_records(json.dumps(data), "a.json") == []


@pytest.mark.parametrize(
    "text",
    [
        *("x,y\n1,2\n", "[1, 2], [3, 4]", "[1, 2]", "[[1, 2], [3]]", "[" * 9999, "[[], []]", "[]", "[[1], 2]", "3"),
        *("{X 1, Y 2}", "p[1, 2]", "[[1], [2]", "{}"),
    ],
)
def test_other_texts_give_no_rows(text: str) -> None:
    """Tables, poses of controllers, lists of numbers, unequal rows and invalid JSON give no rows."""
    assert (json_rows(text), json_records(text, "a.json")) == ("", [])


@pytest.mark.parametrize(
    ("text", "records"),
    [
        ('[{"x": 1, "y": 2}, {"x": 3, "y": 4}]', [(1, {"x": "1", "y": "2"}), (1, {"x": "3", "y": "4"})]),
        ('[\n{"x": 1, "y": 2},\n\n{"y": 4, "x": 3}]', [(2, {"x": "1", "y": "2"}), (4, {"x": "3", "y": "4"})]),
        ('{"x": 1}\n\n{"x": 2}\n', [(1, {"x": "1"}), (3, {"x": "2"})]),
        ('{"x": 1}', [(1, {"x": "1"})]),
        ('{\n"x": 1,\n"y": {"z": 2}}', [(1, {"x": "1", "y.z": "2"})]),
        ('{"of": "poses", "poses": [\n{"p": {"x": 1}, "q": {"w": 2}}]}', [(2, {"p.x": "1", "q.w": "2"})]),
        ('[{"a": [{"b": 1}, 2]}]', [(1, {"a.0.b": "1", "a.1": "2"})]),
        ('[{"a": "x, y", "b": null}, {"c": 1e-5}]', [
            (1, {"a": "x, y", "b": ""}), (1, {"c": "1e-05"}),
        ]),
    ],
)  # fmt: skip
def test_each_object_becomes_record(text: str, records: Records) -> None:
    """Cells have their names in any order, with the line on which the object begins."""
    assert json_records(text, "a.json") == records


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[{"x": 1},\n{"x": 2}', "a.json:2: not JSON: Expecting ',' delimiter; expected objects of numbers by name"),
        ('{"x": 1}\n{"x": 2', "a.json:2: not JSON"),
        ("{'x': 1}\n{'x': 2}", "a.json:1: not JSON: Expecting property name"),
        ('[{"x": 1, "y": 2, "x": 3}]', "a.json: an object has the name 'x' twice: keep one"),
        ('{"poses": [[1, 2]], "times": [3]}', "a.json: holds the lists 'poses', 'times': expected one list of poses"),
        ('[{"x": 1},\n[2]]', "a.json:2: a list of 1 is among objects: expected numbers by name"),
        ('{"x": 1}\n3', "a.json:2: 3 is among objects"),
        ('{"a": ' * 9999, "a.json: not JSON: nested too deeply"),
        ('[{"x": ' + "9" * 5000 + "}]", "a.json: not JSON: nested too deeply, or a number of thousands of digits"),
    ],
)
def test_damaged_objects_are_refused(text: str, message: str) -> None:
    """Damaged objects were read as numbers in file order, whatever their names."""
    with pytest.raises(DatasetError) as caught:
        json_records(text, "a.json")
    assert str(caught.value).startswith(message)


def test_too_many_objects_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The number of objects is checked before a table is made of them."""
    monkeypatch.setattr(module, "MOST_SAMPLES", 2)
    assert len(json_records('[{"x": 1}, {"y": 2}]', "a.json")) == 2
    with pytest.raises(DatasetError, match=r"a.json: 3 objects, expected at most 2"):
        json_records('[{"x": 1}, {"y": 2}, {"z": 3}]', "a.json")
