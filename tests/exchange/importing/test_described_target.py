"""Tests of targets described by options, for a new cell and for images that show them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.cell.files import cell_from_dict, read_cell
from basecal.cell.target import Target
from basecal.cell.targets.apriltag import apriltag_target
from basecal.cell.targets.chessboard import chessboard_target
from basecal.cell.targets.registry import TARGETS
from basecal.cli import main
from basecal.errors import InputError
from basecal.exchange.importing.described_target import Shape, are_indistinguishable, print_sizes, target_fields
from basecal.geometry import SE3

SHAPES = {
    "charuco": Shape(squares="5x7", square="40mm", marker="30mm"),
    "chessboard": Shape(corners="8x6", square="2.5cm"),
    "circles": Shape(circles="7x5", square="30mm", set=("asymmetric=true",)),
    "apriltag": Shape(tag=3, square="80mm"),
    "aprilgrid": Shape(tags="6x6", square="30mm", set=("spacing=0.25",)),
    "led": Shape(),
}


def tag(number: int) -> Target:
    return apriltag_target("tag36h11", [(number, 0.08, SE3.identity())])


@pytest.mark.parametrize("kind", SHAPES)
def test_each_kind_has_its_own_size_options(kind: str) -> None:
    """The fields are read as a cell's, with lengths in metres."""
    fields = target_fields(kind, SHAPES[kind])
    data = {"schema": "basecal/cell/1", "reference": "arm", "robots": {"arm": {}}, "cameras": {"c": {"on": "arm"}}}
    target = cell_from_dict({**data, "targets": {"t": {"on": "world", **fields}}}, "c").targets["t"].target
    assert target is not None
    assert target.kind == kind
    assert len(target.points) == {"charuco": 24, "chessboard": 48, "circles": 35, "apriltag": 4}.get(
        kind, 144 if kind == "aprilgrid" else 1
    )


@pytest.mark.parametrize(("first", "second", "alike"), [
    (chessboard_target((8, 6), 0.03), chessboard_target((8, 6), 0.04), True),
    (chessboard_target((8, 6), 0.03), chessboard_target((7, 5), 0.03), False),
    (tag(3), tag(4), False), (tag(3), tag(3), True), (tag(3), chessboard_target((8, 6), 0.03), False),
])  # fmt: skip
def test_targets_with_equal_marks_are_indistinguishable(first: Target, second: Target, alike: bool) -> None:
    """Boards with equal corner counts, whatever their size, and tags with one number are indistinguishable."""
    assert are_indistinguishable(first, second) == are_indistinguishable(second, first) == alike


def test_all_printable_kinds_are_tested() -> None:
    """Every kind that sizes can describe is tested."""
    assert {*SHAPES} == {kind for kind, each in TARGETS.items() if each.printed is not None}


@pytest.mark.parametrize(
    ("kind", "shape", "message"),
    [
        ("charuco", Shape(), "needs --squares COLUMNSxROWS and --square SIZE"),
        ("charuco", Shape(squares="5x7"), "needs --square SIZE"),
        ("charuco", Shape(squares="5x7", square="40"), "--square '40': expected a length above zero with its unit"),
        ("chessboard", Shape(squares="8x6", square="3cm"), "needs --corners"),
        ("chessboard", Shape(corners="8x6", squares="9x7", square="3cm"), "counted by --corners, not by --squares"),
        ("apriltag", Shape(), "needs --square SIZE"),
        ("apriltag", Shape(tags="2x2", square="3cm"), "is not counted, not by --tags"),
        ("points", Shape(square="3cm"), "needs more than sizes"),
        ("charuco", Shape(squares="5x7", square="4cm", set=("legacy",)), "--set takes FIELD=VALUE"),
    ],
)
def test_missing_sizes_are_reported(kind: str, shape: Shape, message: str) -> None:
    """Sizes that must be measured are not guessed."""
    with pytest.raises(InputError, match=message):
        target_fields(kind, shape)


def photos(folder: Path) -> str:
    folder.mkdir()
    cv2.imwrite(str(folder / "1.png"), np.zeros((48, 64), np.uint8))
    return str(folder)


BOARD = ["--target", "charuco", "--squares", "5x7", "--square", "40mm"]


def test_new_cell_has_given_names_and_target(tmp_path: Path) -> None:
    """The cell is as `new` writes it, without placeholders."""
    assert main(["new", str(tmp_path / "c"), "--names", "left", "right", *BOARD]) == 0
    cell = read_cell(tmp_path / "c")
    assert (cell.reference, [*cell.robots], cell.targets["target"].on) == ("left", ["left", "right"], "right")
    target = cell.targets["target"].target
    assert target is not None
    assert target.options["square_m"] == 0.04
    assert target.options["marker_m"] == 0.03


@pytest.mark.parametrize(
    "words", [["--names", "a", "b", "--robots", "3"], ["--target", "pose", "--square", "3cm"], ["--names", "a", "a"]]
)
def test_contradictory_options_create_no_cell(tmp_path: Path, words: list[str]) -> None:
    """Counts that differ from names, sizes of a target without any, and repeated names are refused."""
    assert main(["new", str(tmp_path / "c"), *words]) in (2, 3)
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize(
    ("robots", "on", "words", "carrier"),
    [
        (["left"], "left", [], "world"),
        (["left"], "world", [], "left"),
        (["left", "right"], "left", [], "right"),
        (["left", "right"], "world", ["--target-on", "left"], "left"),
        (["left"], "left", ["--target-on", "right"], "right"),
    ],
)
def test_images_add_their_target(
    tmp_path: Path, robots: list[str], on: str, words: list[str], carrier: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The default carrier of the target is the one robot without the camera, or the world; it is reported."""
    cell = str(tmp_path / "c")
    poses = tmp_path / "t.csv"
    poses.write_text("x,y,z,rx,ry,rz\n0.4,0.1,0.3,0,0,0\n")
    for robot in robots:
        assert main(["import", "poses", cell, "--robot", robot, str(poses), "--format", "ur"]) == 0
    images = ["import", "images", cell, photos(tmp_path / "p"), "--camera", "cam", "--on", on]
    assert main([*images, *BOARD, "--target-name", "plate", *words]) == 0
    assert f"target 'plate', charuco on '{carrier}'" in capsys.readouterr().out
    assert read_cell(cell).targets["plate"].on == carrier


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ([*BOARD], 3, "give the carrier of the target 'board': --target-on ROBOT or --target-on world"),
        (["--squares", "5x7"], 2, "a target is described, but not its kind: add --target"),
        (["--target-on", "arm"], 2, "a target is described, but not its kind: add --target"),
    ],
)
def test_incomplete_target_description_is_refused(
    tmp_path: Path, words: list[str], code: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """If the robots are unknown, the carrier is not guessed."""
    cell = str(tmp_path / "c")
    images = ["import", "images", cell, photos(tmp_path / "p"), "--camera", "cam", "--on", "arm"]
    assert main([*images, *words]) == code
    assert message in capsys.readouterr().err
    assert not (tmp_path / "c").exists()


def test_indistinguishable_boards_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A second board of the same dictionary may be the same board, unless another dictionary is stated."""
    cell = str(tmp_path / "c")
    places = ["--on", "arm", "--target-on", "world", *BOARD]
    assert main(["import", "images", cell, photos(tmp_path / "p"), "--camera", "cam", *places]) == 0
    second = ["import", "images", cell, photos(tmp_path / "q"), "--camera", "other", *places]
    assert main([*second, "--target-name", "plate"]) == 3
    message = capsys.readouterr().err
    assert "no image distinguishes 'plate' from 'board'" in message
    assert "Otherwise state its own dictionary" in message
    assert [*read_cell(cell).targets] == ["board"]
    assert main([*second, "--target-name", "plate", "--dictionary", "DICT_5X5_50"]) == 0
    assert [*read_cell(cell).targets] == ["board", "plate"]


@pytest.mark.parametrize(("columns", "rows", "name"), [(10, 10, "50"), (10, 11, "100"), (1, 101, "50"), (2, 51, "100")])
def test_dictionary_has_marker_for_every_other_square(columns: int, rows: int, name: str) -> None:
    """The smallest sufficient dictionary is chosen and a stated one is kept; a marker has its share of the square."""
    sizes = print_sizes(columns, rows, 0.04, None, None, "tag36h11", 0)
    assert sizes.dictionary == f"DICT_4X4_{name}"
    assert 0 < sizes.marker_m < sizes.square_m == 0.04
    stated = print_sizes(columns, rows, 0.04, 0.01, "DICT_6X6_50", "tag36h11", 0)
    assert (stated.dictionary, stated.marker_m) == ("DICT_6X6_50", 0.01)
