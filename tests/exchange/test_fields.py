"""Tests of fields of other programs' files, and of the errors for missing ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.errors import DatasetError
from basecal.exchange.fields import parse_fields, parse_float, read_fields

TEXT = """\
name: wrist
size: [640, 480]
matrix:
  data: [[1, 2], [3, 4.5]]
on: true
pose: {x: 0.1, y: 0.2, z: 0.3, qx: 0, qy: 0, qz: 0, qw: 1}
"""


def test_fields_are_read_by_type() -> None:
    """Text, integers, nested rows, booleans and the first of several names are read."""
    root = parse_fields(TEXT, "a.yaml")
    assert root.find("camera", "name").text() == "wrist"
    assert [side.integer() for side in root.find("size").items("sides")] == [640, 480]
    assert root.find("size").size() == (640, 480)
    assert root.find("matrix").find("data").numbers(4) == [1, 2, 3, 4.5]
    assert root.find("matrix").matrix(4) == root.find("matrix").find("data").matrix(4) == [1, 2, 3, 4.5]
    assert root.find("on").boolean()
    assert root.first("nothing") is None


@pytest.mark.parametrize(
    "text",
    [
        "{x: 1, y: 2, z: 3, qx: 0, qy: 0, qz: 1, qw: 0}",
        "{translation: {x: 1, y: 2, z: 3}, rotation: {x: 0, y: 0, z: 1, w: 0}}",
        "{position: {x: 1, y: 2, z: 3}, orientation: {x: 0, y: 0, z: 1, w: 0}}",
        "[-1, 0, 0, 1, 0, -1, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1]",
        "[[-1, 0, 0, 1], [0, -1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]",
    ],
)
def test_all_pose_notations_are_read(text: str) -> None:
    """A half turn about z at (1, 2, 3) is read as in ROS, as seven numbers, and as a matrix."""
    expected = [[-1, 0, 0, 1], [0, -1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    np.testing.assert_allclose(parse_fields(text, "a.yaml").pose().matrix, expected, atol=1e-15)


@pytest.mark.parametrize("ending", ["---\n", "\n---", "...\n", "---\n---\n\n"])
def test_trailing_separators_are_ignored(ending: str) -> None:
    """The separator that `topic echo` prints after a message is not a second document."""
    assert parse_fields("a: 1\n" + ending, "a.yaml").find("a").integer() == 1


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda root: root.find("nme"), r"a.yaml:1: has no nme \(did you mean 'name'\?\); it has name, size"),
        (lambda root: root.find("name").number(), r"a.yaml:1: name: is 'wrist', expected a number"),
        (lambda root: root.find("on").number(), r"a.yaml:5: on: is True, expected a number"),
        (lambda root: root.find("size").numbers(3), r"a.yaml:2: size: has 2 numbers, expected 3"),
        (lambda root: root.find("name").find("x"), r"name: is 'wrist', expected a mapping with 'x'"),
        (lambda root: root.find("name").items("sides"), r"name: is 'wrist', expected a list of sides"),
        (lambda root: root.find("size").text(), r"size: is a list of 2, expected text"),
        (lambda root: parse_fields("a: [1, 2, 3]", "a.yaml").find("a").size(), r"a: has 3 numbers, expected width and"),
        (lambda root: root.find("name").boolean(), r"name: is 'wrist', expected true or false"),
        (
            lambda root: root.find("matrix").find("data").items("rows")[1].items("x")[1].integer(),
            r"matrix.data\[1\]\[1\]: is",
        ),
        (lambda root: root.find("size").pose(), r"a.yaml:2: size: has 2 numbers, expected 16"),
    ],
)
def test_invalid_field_error_has_location(ask: object, message: str) -> None:
    """The error has path, line and field, the actual value and the expected one."""
    with pytest.raises(DatasetError, match=message):
        ask(parse_fields(TEXT, "a.yaml"))  # type: ignore[operator]


@pytest.mark.parametrize("value", [".nan", "-.inf", "1e300", f"1{400 * '0'}", "[]", "null", "'1'"])
def test_invalid_numbers_are_refused(value: str) -> None:
    """Non-finite values, values far beyond any length, and text that looks like a number are refused."""
    with pytest.raises(DatasetError):
        parse_fields(f"a: {value}", "a.yaml").find("a").number()


@pytest.mark.parametrize("quaternion", ["qx: 0, qy: 0, qz: 0, qw: 0", "qx: 0, qy: 0, qz: 0.5, qw: 1"])
def test_invalid_quaternion_is_reported(quaternion: str) -> None:
    """A quaternion without unit norm is reported with its norm and line."""
    with pytest.raises(DatasetError, match=r"a.yaml:2: p: quaternion has norm"):
        parse_fields(f"\np: {{x: 0, y: 0, z: 0, {quaternion}}}", "a.yaml").find("p").pose()


def test_unreadable_files_are_reported(tmp_path: Path) -> None:
    """A missing file, a folder, binary data and invalid YAML are errors that name the file."""
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "open.yaml").write_text("a: [1, 2\n")
    for name in ("none.yaml", ".", "bytes.yaml", "open.yaml"):
        with pytest.raises(DatasetError, match=name):
            read_fields(tmp_path / name)


@pytest.mark.parametrize(("value", "found"), [("true", True), ("false", False), ("1", True), ("0", False)])
def test_booleans_may_be_zero_and_one(value: str, found: bool) -> None:
    """Other numbers, and text, are refused."""
    assert parse_fields(f"a: {value}", "a.yaml").find("a").boolean() is found
    for other in ("2", "-1", "1.0", "0.0", "'true'", "[1]"):
        with pytest.raises(DatasetError, match="expected true or false"):
            parse_fields(f"a: {other}", "a.yaml").find("a").boolean()


@pytest.mark.parametrize(
    ("value", "low", "is_whole"),
    [("1", 1, True), ("0", 1, False), ("0", 0, True), ("2.0", 2, True), ("2.5", 1, False), ("-1", 0, False)],
)
def test_integers_have_lower_limit(value: str, low: int, is_whole: bool) -> None:
    """The default lower limit is 1; an integer may be written with a decimal point."""
    field = parse_fields(f"a: {value}", "a.yaml").find("a")
    if is_whole:
        assert field.integer(low) == float(value)
    else:
        with pytest.raises(DatasetError, match=f"expected a whole number from {low}"):
            field.integer(low)
    assert parse_fields("a: 1", "a.yaml").find("a").integer() == 1
    with pytest.raises(DatasetError, match="expected a whole number from 1"):
        parse_fields("a: 0", "a.yaml").find("a").integer()


@pytest.mark.parametrize("value", ["1e6", "-1e6", "1000000"])
def test_numbers_up_to_a_million_are_read(value: str) -> None:
    """Either sign is accepted; the error for a larger number states the limit."""
    assert abs(parse_fields(f"a: {value}", "a.yaml").find("a").number()) == 1e6
    for beyond in ("1000001", "-1.1e6"):
        with pytest.raises(DatasetError, match=r"beyond 1e\+06"):
            parse_fields(f"a: {beyond}", "a.yaml").find("a").number()


def test_number_lists_have_requested_length() -> None:
    """Lists have any length by default, also zero, or one of the requested lengths.

    Rows of different lengths are flattened.
    """
    root = parse_fields("a: []\nb: [1, 2]\nc: [[1], [2, 3]]\nd: [1, [2]]\ne: 3\nf: [[1], []]", "a.yaml")
    assert root.find("a").numbers() == []
    assert root.find("b").numbers(4, 2) == [1, 2]
    assert root.find("c").numbers(3) == [1, 2, 3]
    with pytest.raises(DatasetError, match="b: has 2 numbers, expected 3 or 4"):
        root.find("b").numbers(3, 4)
    with pytest.raises(DatasetError, match="a: has 0 numbers, expected 2"):
        root.find("a").numbers(2)
    for name, message in (
        ("d", r"d\[1\]: is a list of 1"),
        ("e", "e: is 3, expected a list of"),
        ("f", r"f\[1\]: is an empty"),
    ):
        with pytest.raises(DatasetError, match=message):
            root.find(name).numbers()


def test_empty_fields_count_as_missing() -> None:
    """The next name is used instead of an empty field; a field that is not a mapping has no names."""
    root = parse_fields("a:\nb: 0\nc: 1", "a.yaml")
    assert root.find("a", "b", "c").number() == 0
    assert root.first("a") is None
    assert root.find("b").first("x") is None
    with pytest.raises(DatasetError, match=r"has no a or d.*; it has b, c"):
        root.find("a", "d")
    assert (root.names(), root.find("b").names()) == (["a", "b", "c"], [])
    assert [parse_float(text) for text in ("1", "-.5e1")] == [1.0, -5.0]
    with pytest.raises(ValueError, match="1_0"):
        parse_float("1_0")
