"""What an import read, as a noun."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from basecal.cell import Cell, CellCamera, CellTarget, PoseObservation, Robot
from basecal.cli import main
from basecal.errors import InputError
from basecal.exchange.importing.imported import (
    NO_CELL,
    Imported,
    KnownCell,
    Row,
    ViewNames,
    add_target_poses,
    carried_entry,
    check_robot,
    choose_carrier,
    choose_name,
    known_cell,
    recorded_samples,
    replaceable_size,
    view_entry,
)
from basecal.geometry import SE3

ONE = Cell("arm", {"arm": Robot("arm")}, {}, {}, {})
TWO = Cell("left", {"left": Robot("left"), "right": Robot("right")}, {}, {}, {})
FULL = Cell("left", TWO.robots, {}, {"eye": CellCamera("eye", "left")}, {"tag": CellTarget("tag", "right")})
BOTH = Cell("a", {"a": Robot("a"), "b": Robot("b")}, {}, {}, {})
SEEN = Cell("a", BOTH.robots, {}, {"eye": CellCamera("eye", "a")}, {"tag": CellTarget("tag", "b")})


def test_nothing_is_said_by_default() -> None:
    """A row without keys is paired by order, and an import without a cell adds nothing to it."""
    row, imported = Row(), Imported("a.csv", "poses")
    assert (row.image, row.sample, row.stamp_s) == (None, None, None)
    assert (imported.rows, dict(imported.cell), imported.new_cell) == ((), {}, None)
    with pytest.raises(dataclasses.FrozenInstanceError):
        row.sample = 3  # type: ignore[misc]


@pytest.mark.parametrize(
    ("name", "names", "usual", "chosen"),
    [("a", ("b", "c"), "", "a"), (None, ("b",), "d", "b"), (None, (), "d", "d")],
)
def test_the_given_name_then_the_only_one_then_the_usual_one(
    name: str | None, names: tuple[str, ...], usual: str, chosen: str
) -> None:
    """In this order."""
    assert choose_name("camera", name, names, usual) == chosen


@pytest.mark.parametrize(
    ("names", "usual", "said"),
    [(("b", "c"), "d", "which camera.*: b, c"), ((), "", "which camera.*: none in this cell: add a camera first")],
)
def test_a_name_that_is_not_clear_is_asked_for(names: tuple[str, ...], usual: str, said: str) -> None:
    """Where there are several, or none where one must be."""
    with pytest.raises(InputError, match=said):
        choose_name("camera", None, names, usual)


@pytest.mark.parametrize(
    ("cell", "name", "stated", "carrier"),
    [
        (FULL, "eye", None, "left"),
        (FULL, "eye", "left", "left"),
        (FULL, "new", "right", "right"),
        (FULL, "new", "world", "world"),
        (ONE, "new", None, "arm"),
        (NO_CELL, "new", "other", "other"),
        (ONE, "new", "arm2", "arm2"),
    ],
)
def test_what_carries_a_camera(cell: KnownCell, name: str, stated: str | None, carrier: str) -> None:
    """As the cell has it, as stated, or its only robot; a robot may be new."""
    assert choose_carrier(cell, "camera", name, stated) == carrier


@pytest.mark.parametrize(
    ("cell", "name", "stated", "said"),
    [
        (
            FULL,
            "eye",
            "right",
            "camera 'eye' is on 'left' in cell.yaml, not on 'right': omit --on, or correct it",
        ),
        (TWO, "eye", None, "camera 'eye' is new: give its carrier with --on, one of: left, right, world"),
        (NO_CELL, "eye", None, "--on, one of: a robot$"),
        (NO_CELL, "eye", "world", "camera 'eye' on the world needs a robot, and there is no cell.yaml"),
    ],
)
def test_a_carrier_that_is_not_clear_is_asked_for(cell: KnownCell, name: str, stated: str | None, said: str) -> None:
    """It contradicts the cell, or is missing."""
    with pytest.raises(InputError, match=said):
        choose_carrier(cell, "camera", name, stated, may_be_world=False)


def test_a_misspelt_robot_or_world_is_told() -> None:
    """A new name of a robot passes."""
    check_robot(TWO, "third")
    with pytest.raises(InputError, match="did you mean 'world'"):
        check_robot(TWO, "wrold")
    with pytest.raises(InputError, match=r"no robot 'lfet' \(did you mean 'left'\?\); there are: left, right"):
        check_robot(TWO, "lfet")


def test_sections_of_what_is_new() -> None:
    """With the robot that carries it, which may be new as well."""
    camera = {"cameras": {"eye": {"on": "arm", "model": "pinhole"}}}
    assert carried_entry("cameras", "eye", "arm", model="pinhole") == {"robots": {"arm": {}}, **camera}
    assert carried_entry("targets", "tag", "world") == {"targets": {"tag": {"on": "world"}}}


@pytest.mark.parametrize(
    ("cell", "sight", "carriers"),
    [
        (NO_CELL, ViewNames("eye", "tag", "left"), ("left", "world")),
        (ONE, ViewNames("eye", "tag"), ("arm", "world")),
        (ONE, ViewNames("eye", "tag", "world"), ("world", "arm")),
        (BOTH, ViewNames("eye", "tag", "a", "b"), ("a", "b")),
        (BOTH, ViewNames("eye", "tag", "world", "b"), ("world", "b")),
    ],
)
def test_carriers_of_what_is_seen(cell: KnownCell, sight: ViewNames, carriers: tuple[str, str]) -> None:
    entry = view_entry(cell, sight)
    assert (entry["cameras"]["eye"]["on"], entry["targets"]["tag"]["on"]) == carriers
    assert set(entry["robots"]) == set(carriers) - {"world"}


def test_what_the_cell_says_stays() -> None:
    assert view_entry(SEEN, ViewNames("eye", "tag"))["cameras"] == {"eye": {}}


@pytest.mark.parametrize(
    ("cell", "sight", "said"),
    [
        (BOTH, ViewNames("eye", "tag"), "--on, one of: a, b, world"),
        (BOTH, ViewNames("eye", "tag", "world"), "--target-on, one of: a, b, world"),
        (NO_CELL, ViewNames("eye", "tag"), "--on, one of: a robot or world"),
        (SEEN, ViewNames("eye", "tag", "b"), "camera 'eye' is on 'a' in cell.yaml, not on 'b'"),
        (SEEN, ViewNames("eye", "tag", None, "world"), "target 'tag' is on 'b' in cell.yaml, not on 'world'"),
        (ONE, ViewNames("eye", "tag", "arm", "arm"), "both on 'arm'"),
    ],
)
def test_what_is_not_clear_is_an_error(cell: KnownCell, sight: ViewNames, said: str) -> None:
    with pytest.raises(InputError, match=said):
        view_entry(cell, sight)


def test_each_row_gets_its_view() -> None:
    poses = SE3.exp(np.random.default_rng(0).normal(0, 0.3, (2, 6)))
    found = add_target_poses((Row(stamp_s=1.0), Row(stamp_s=2.0)), poses, ViewNames("eye", "tag"))
    assert [row.stamp_s for row in found] == [1.0, 2.0]
    view = found[1].observations[0]
    assert isinstance(view, PoseObservation)
    np.testing.assert_array_equal(view.camera_from_target.matrix, poses[1].matrix)


def test_a_cell_that_may_be_there(tmp_path: Path) -> None:
    """None before it is made, and no samples before they are recorded."""
    assert known_cell(tmp_path / "c") is NO_CELL
    main(["new", str(tmp_path / "c"), "--names", "left"])
    cell = known_cell(tmp_path / "c")
    assert cell is not None
    assert [*cell.robots] == ["left"]
    assert recorded_samples(tmp_path / "c", cell) == ()
    (tmp_path / "c" / "recording" / "samples.jsonl").unlink()
    assert recorded_samples(tmp_path / "c", cell) == ()


def test_samples_that_are_recorded(tmp_path: Path) -> None:
    """All of them."""
    main(["simulate", str(tmp_path / "c"), "--samples", "3"])
    cell = known_cell(tmp_path / "c")
    assert cell is not None
    assert [sample.sample for sample in recorded_samples(tmp_path / "c", cell)] == [0, 1, 2]


@pytest.mark.parametrize(
    ("seen", "is_open"),
    [
        ({}, True),
        ({"images": {"camera": "a.png"}}, False),
        ({"observations": [{"camera": "camera", "target": "target", "ids": [0], "pixels": [[1, 2]]}]}, False),
    ],
)
def test_a_size_is_open_until_something_was_seen(tmp_path: Path, seen: dict[str, object], is_open: bool) -> None:
    """An image and an observation of the camera both rest on it."""
    main(["new", str(tmp_path), "--names", "left"])
    cell = known_cell(tmp_path)
    assert cell is not None
    (tmp_path / "recording" / "samples.jsonl").write_text(json.dumps({"sample": 0, **seen}) + "\n", encoding="utf-8")
    (name,) = cell.cameras
    found = replaceable_size(tmp_path, cell, name)
    assert found == (frozenset({("cameras", name, "size_px")}) if is_open else frozenset())
