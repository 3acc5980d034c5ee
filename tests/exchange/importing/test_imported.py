"""Tests of the data that an import has read."""

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


def test_import_defaults_are_empty() -> None:
    """A row without keys is paired by order, and an import without a cell adds no entries to it."""
    row, imported = Row(), Imported("a.csv", "poses")
    assert (row.image, row.sample, row.stamp_s) == (None, None, None)
    assert (imported.rows, dict(imported.cell), imported.new_cell) == ((), {}, None)
    with pytest.raises(dataclasses.FrozenInstanceError):
        row.sample = 3  # type: ignore[misc]


@pytest.mark.parametrize(
    ("name", "names", "usual", "chosen"),
    [("a", ("b", "c"), "", "a"), (None, ("b",), "d", "b"), (None, (), "d", "d")],
)
def test_name_choice_order(name: str | None, names: tuple[str, ...], usual: str, chosen: str) -> None:
    """The given name is used, then the only one, then the usual one."""
    assert choose_name("camera", name, names, usual) == chosen


@pytest.mark.parametrize(
    ("names", "usual", "message"),
    [(("b", "c"), "d", "which camera.*: b, c"), ((), "", "which camera.*: none in this cell: add a camera first")],
)
def test_ambiguous_name_is_requested(names: tuple[str, ...], usual: str, message: str) -> None:
    """A name is requested if there are several, or none though one is needed."""
    with pytest.raises(InputError, match=message):
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
def test_camera_carrier_choice(cell: KnownCell, name: str, stated: str | None, carrier: str) -> None:
    """The carrier is that of the cell, the stated one, or the only robot; a robot may be new."""
    assert choose_carrier(cell, "camera", name, stated) == carrier


@pytest.mark.parametrize(
    ("cell", "name", "stated", "message"),
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
def test_unclear_carrier_is_requested(cell: KnownCell, name: str, stated: str | None, message: str) -> None:
    """A carrier that contradicts the cell, or is missing, is an error."""
    with pytest.raises(InputError, match=message):
        choose_carrier(cell, "camera", name, stated, may_be_world=False)


def test_misspelt_robot_or_world_is_reported() -> None:
    """A new name of a robot is accepted."""
    check_robot(TWO, "third")
    with pytest.raises(InputError, match="did you mean 'world'"):
        check_robot(TWO, "wrold")
    with pytest.raises(InputError, match=r"no robot 'lfet' \(did you mean 'left'\?\); there are: left, right"):
        check_robot(TWO, "lfet")


def test_new_entries_include_their_robot() -> None:
    """The entry includes the carrying robot, which may be new as well."""
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
def test_camera_and_target_carriers_of_view(cell: KnownCell, sight: ViewNames, carriers: tuple[str, str]) -> None:
    """Camera and target get the stated carriers, or the robot and the world."""
    entry = view_entry(cell, sight)
    assert (entry["cameras"]["eye"]["on"], entry["targets"]["tag"]["on"]) == carriers
    assert set(entry["robots"]) == set(carriers) - {"world"}


def test_existing_camera_entry_is_kept() -> None:
    """A camera of the cell keeps its entry."""
    assert view_entry(SEEN, ViewNames("eye", "tag"))["cameras"] == {"eye": {}}


@pytest.mark.parametrize(
    ("cell", "sight", "message"),
    [
        (BOTH, ViewNames("eye", "tag"), "--on, one of: a, b, world"),
        (BOTH, ViewNames("eye", "tag", "world"), "--target-on, one of: a, b, world"),
        (NO_CELL, ViewNames("eye", "tag"), "--on, one of: a robot or world"),
        (SEEN, ViewNames("eye", "tag", "b"), "camera 'eye' is on 'a' in cell.yaml, not on 'b'"),
        (SEEN, ViewNames("eye", "tag", None, "world"), "target 'tag' is on 'b' in cell.yaml, not on 'world'"),
        (ONE, ViewNames("eye", "tag", "arm", "arm"), "both on 'arm'"),
    ],
)
def test_unclear_view_carriers_are_refused(cell: KnownCell, sight: ViewNames, message: str) -> None:
    """Missing, contradicting and equal carriers are errors."""
    with pytest.raises(InputError, match=message):
        view_entry(cell, sight)


def test_each_row_gets_target_pose() -> None:
    """Each row keeps its time and gets the pose of the target."""
    poses = SE3.exp(np.random.default_rng(0).normal(0, 0.3, (2, 6)))
    found = add_target_poses((Row(stamp_s=1.0), Row(stamp_s=2.0)), poses, ViewNames("eye", "tag"))
    assert [row.stamp_s for row in found] == [1.0, 2.0]
    view = found[1].observations[0]
    assert isinstance(view, PoseObservation)
    np.testing.assert_array_equal(view.camera_from_target.matrix, poses[1].matrix)


def test_missing_cell_and_recording_are_empty(tmp_path: Path) -> None:
    """There is no cell before it is made, and no samples before they are recorded."""
    assert known_cell(tmp_path / "c") is NO_CELL
    main(["new", str(tmp_path / "c"), "--names", "left"])
    cell = known_cell(tmp_path / "c")
    assert cell is not None
    assert [*cell.robots] == ["left"]
    assert recorded_samples(tmp_path / "c", cell) == ()
    (tmp_path / "c" / "recording" / "samples.jsonl").unlink()
    assert recorded_samples(tmp_path / "c", cell) == ()


def test_recorded_samples_are_read(tmp_path: Path) -> None:
    """All recorded samples are returned."""
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
def test_image_size_is_replaceable_until_recorded(tmp_path: Path, seen: dict[str, object], is_open: bool) -> None:
    """An image, and an observation of the camera, both depend on the size."""
    main(["new", str(tmp_path), "--names", "left"])
    cell = known_cell(tmp_path)
    assert cell is not None
    (tmp_path / "recording" / "samples.jsonl").write_text(json.dumps({"sample": 0, **seen}) + "\n", encoding="utf-8")
    (name,) = cell.cameras
    found = replaceable_size(tmp_path, cell, name)
    assert found == (frozenset({("cameras", name, "size_px")}) if is_open else frozenset())
