"""Tests of one line of a recording."""

from __future__ import annotations

import json

import pytest

from basecal.cell.files import cell_from_dict
from basecal.cell.journal.sample_line import DroppedSample, line_data, make_context, sample_from_line
from basecal.cell.journal.sample_values import FileLine
from basecal.errors import DatasetError, InputError

HERE = FileLine("samples.jsonl", 2)
CELL = cell_from_dict(
    {
        "schema": "basecal/cell/1",
        "reference": "arm",
        "robots": {"arm": {}},
        "cameras": {"eye": {"on": "arm"}},
        "targets": {"board": {"on": "world", "kind": "points", "points_m": [[0, 0, 0], [1, 0, 0]]}},
    }
)
POSE = {"base_from_flange": {"t_m": [1, 2, 3], "q_xyzw": [0, 0, 0, 1]}}
POINT = {"camera": "eye", "target": "board", "ids": [1], "points_in_camera_m": [[0, 0, 1]]}


def path_in_cell(path: str) -> str:
    if path == "out":
        raise InputError("leaves the cell")
    return f"recording/{path}"


def read(line):
    text = line if isinstance(line, bytes) else json.dumps(line).encode()
    return sample_from_line(text, HERE, make_context(CELL, path_in_cell))


def test_sample_is_read():
    """Number, time, robots, paths and observations are read; fields that are not written are empty."""
    sample = read(
        {"sample": 5, "stamp_s": 1.5, "robots": {"arm": POSE}, "images": {"eye": "a.png"}, "observations": [POINT]}
    )
    assert (sample.sample, sample.stamp_s, sample.images) == (5, 1.5, {"eye": "recording/a.png"})
    assert sample.robots["arm"].base_from_flange.translation.tolist() == [1, 2, 3]
    assert [seen.ids.tolist() for seen in sample.observations] == [[1]]
    empty = read({"sample": 0})
    assert (empty.stamp_s, empty.robots, empty.images, empty.background, empty.observations) == (None, {}, {}, {}, ())


@pytest.mark.parametrize(
    ("line", "field", "message"),
    [
        ({}, "sample", "0 or more, got None"),
        ({"sample": -1}, "sample", "0 or more, got -1"),
        ({"sample": 1.0}, "sample", "0 or more, got 1.0"),
        ({"sample": 2**53}, "sample", "0 or more"),
        ({"sample": True}, "sample", "got true or false"),
        ({"sample": 1, "stamp_s": None}, "stamp_s", "finite number within 1e+12"),
        ({"sample": 1, "stamp_s": 1.1e12}, "stamp_s", "finite number"),
        ({"sample": 1, "robot": {}}, "robot", "did you mean 'robots'"),
        ({"sample": 1, "robots": []}, "robots", "expected an object"),
        ({"sample": 1, "robots": {"am": POSE}}, "robots.am", "did you mean 'arm'"),
        ({"sample": 1, "robots": {"arm": {}}}, "robots.arm", "got neither"),
        ({"sample": 1, "robots": {"arm": {**POSE, "joints_rad": [1]}}}, "robots.arm", "got both"),
        ({"sample": 1, "robots": {"arm": {"joints_rad": [1]}}}, "robots.arm.joints_rad", "joints need urdf"),
        ({"sample": 1, "images": {"ear": "a.png"}}, "images.ear", "no camera"),
        ({"sample": 1, "images": {"eye": 5}}, "images.eye", "expected a path, got 5"),
        ({"sample": 1, "background": {"eye": "out"}}, "background.eye", "leaves the cell"),
        ({"sample": 1, "observations": {}}, "observations", "expected a list, got a mapping"),
        ({"sample": 1, "observations": [POINT, POINT]}, "observations[1]", "'eye' sees 'board' twice"),
        ({"sample": 1, "observations": [{**POINT, "ids": [True]}]}, "observations.0.ids.0", "true or false"),
    ],
)
def test_invalid_sample_error_names_field(line, field, message):
    """The error names the field and the expected value."""
    with pytest.raises(DatasetError) as caught:
        read(line)
    assert (caught.value.field, caught.value.line) == (field, 2)
    assert message in caught.value.reason


def test_largest_sample_number():
    """Numbers below 2^53 are accepted, which every JSON reader keeps."""
    assert read({"sample": 2**53 - 1}).sample == 2**53 - 1


def test_unknown_point_drops_sample():
    """The dropped sample states its number, line and reason; the rest of the recording counts."""
    found = read({"sample": 7, "observations": [{**POINT, "ids": [2]}]})
    assert isinstance(found, DroppedSample)
    assert (found.sample, found.line) == (7, 2)
    assert str(found.reason) == "id 2 is not on 'board', whose ids are 0 to 1"
    assert (found.reason.target, found.reason.ids, found.reason.known) == ("board", {2}, {0, 1})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b'{"sample": 1},', "remove the comma after the object"),
        ('{"sample": 1}'.encode("utf-16"), "it is UTF-16, save it as UTF-8"),
    ],
)
def test_common_line_mistakes_have_fix(text, words):
    """A comma between objects, and UTF-16 as a spreadsheet saves it, are reported with the fix."""
    with pytest.raises(DatasetError) as caught:
        line_data(text, HERE)
    assert words in caught.value.reason


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b'{"sample": 1', "not JSON (Expecting ',' delimiter, column 13); expected one object a line"),
        (b'{"sample": "\xff"}', "not UTF-8 text (byte 12 of the line)"),
        (b'{"sample": 1, "sample": 2}', "the key 'sample' is given twice"),
        (b'{"sample": 1, "robots": {"arm": {}, "arm": {}}}', "the key 'arm' is given twice"),
        (b"[" * 100_000, "nested too deeply"),
        (b'{"sample": ' + b"9" * 5000 + b"}", "a whole number has thousands of digits; expected one JSON object"),
        (b"[1]", "expected an object"),
    ],
)
def test_malformed_lines_are_refused(text, message):
    """Truncated lines, other encodings, duplicate keys, deep nesting and lists are refused."""
    with pytest.raises(DatasetError) as caught:
        read(text)
    assert message in str(caught.value)


def test_line_data_keeps_order():
    """Values are read unchanged, in the order of the line."""
    assert list(line_data(b'{"b": 1, "a": [2.5, "x", null]}', HERE).items()) == [("b", 1), ("a", [2.5, "x", None])]
