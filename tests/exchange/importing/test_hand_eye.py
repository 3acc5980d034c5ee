"""Tests of the import of hand-eye recordings into a cell."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.cell import Cell, PoseObservation, Recording, Unknown
from basecal.cell.files import read_cell
from basecal.cell.format.yaml_text import yaml_text
from basecal.errors import InputError
from basecal.exchange.importing.bring_in import add_to_cell
from basecal.exchange.importing.hand_eye import (
    Carriers,
    HandEyeRecord,
    Names,
    _mount,
    chosen_names,
    hand_eye_of_file,
    imported_hand_eye,
    is_camera_on_robot,
)
from basecal.exchange.importing.imported import NO_CELL, KnownCell
from basecal.geometry import SE3

POSES = SE3.exp(np.random.default_rng(7).normal(size=(3, 6)) * 0.4)
SEEN = SE3.exp(np.random.default_rng(8).normal(size=(3, 6)) * 0.4)


def make_record(on_robot: bool, **more: object) -> HandEyeRecord:
    return HandEyeRecord("a.samples", "3 samples", on_robot, POSES, SEEN, **more)  # type: ignore[arg-type]


def cell_in(folder: Path, **more: object) -> Cell:
    words = {"schema": "basecal/cell/1", "reference": "arm", "robots": {"arm": {}}, **more}
    (folder / "cell.yaml").write_text(yaml_text(words))
    return read_cell(folder)


def import_record(folder: Path, cell: KnownCell, record: HandEyeRecord, names: Names) -> tuple[Cell, Recording]:
    done = add_to_cell(folder, imported_hand_eye(cell, record, names), lambda _, __: ())
    return done.cell, done.recording


@pytest.mark.parametrize(("on_robot", "robot"), [(True, "eye"), (False, "hand")])
def test_hand_eye_recording_becomes_cell(tmp_path: Path, on_robot: bool, robot: str) -> None:
    """The robot carries the camera or the target, the other is on the world; frames and guesses are kept."""
    names = chosen_names(NO_CELL, None, None, None, on_robot)
    assert names == Names(robot, "camera", "target")
    record = make_record(on_robot, frames={"base": "base_link"}, camera_mount=POSES[0])
    cell, recording = import_record(tmp_path, NO_CELL, record, names)
    assert (cell.cameras["camera"].on, cell.targets["target"].on) == (
        (robot, "world") if on_robot else ("world", robot)
    )
    assert cell.robots[robot].frames["base"] == "base_link"
    assert cell.cameras["camera"].mount.status == "free"
    assert cell.cameras["camera"].mount.mean is not None
    state = recording.samples[1].robots[robot].base_from_flange
    assert state is not None
    np.testing.assert_allclose(state.matrix, POSES[1].matrix, atol=1e-12)
    (seen,) = recording.samples[1].observations
    assert isinstance(seen, PoseObservation)
    np.testing.assert_allclose(seen.camera_from_target.matrix, SEEN[1].matrix, atol=1e-12)


@pytest.mark.parametrize("on_robot", [True, False])
def test_mount_guess_needs_same_robot(on_robot: bool) -> None:
    """A target pose in the file's base is not its pose in the flange of a second robot.

    The same applies to a camera.
    """
    record, names = (
        make_record(on_robot, camera_mount=POSES[0], target_mount=POSES[1]),
        Names("arm", "camera", "target"),
    )
    carried, other = ("camera", "target") if on_robot else ("target", "camera")
    for carrier, is_guessed in (("world", True), ("right", False)):
        cell = imported_hand_eye(NO_CELL, record, names, carriers=Carriers(carrier, carrier)).cell
        assert "guess" in cell[f"{carried}s"][carried]["mount"]
        assert ("guess" in cell[f"{other}s"][other]["mount"]) == is_guessed


def test_existing_cell_provides_names_and_carrier(tmp_path: Path) -> None:
    """The only camera and target, and the carrying robot, are used; a stated mount is kept."""
    mount = {"status": "fixed", "t_m": [0, 0, 0.1], "q_xyzw": [0, 0, 0, 1]}
    cell = cell_in(tmp_path, cameras={"wrist": {"on": "arm", "mount": mount}}, targets={"tag": {"on": "world"}})
    assert is_camera_on_robot(cell, None) is True
    names = chosen_names(cell, None, None, None, True)
    assert names == Names("arm", "wrist", "tag")
    after, recording = import_record(tmp_path, cell, make_record(True, camera_mount=POSES[0]), names)
    assert after.cameras["wrist"].mount.status == "fixed"
    assert len(recording.samples) == 3
    assert is_camera_on_robot(NO_CELL, None) is None
    assert is_camera_on_robot(cell, "other") is None


def test_contradicting_carrier_is_reported(tmp_path: Path) -> None:
    """If cell.yaml has the camera on the world and the file on the robot, the line is reported."""
    cell = cell_in(tmp_path, cameras={"hall": {"on": "world"}}, targets={"tag": {"on": "arm"}})
    with pytest.raises(InputError, match=r"cell.yaml:\d+: cameras.hall.on: is world, but arm in the imported data"):
        import_record(tmp_path, cell, make_record(True), Names("arm", "hall", "tag"))


def test_stationary_second_arm_of_hand_eye(tmp_path: Path) -> None:
    """One arm carries the camera and the other the target. The user or the file states which of them moved."""
    first = make_record(True)
    cell, _ = import_file(tmp_path, first, Carriers("left", "right"), None)
    assert (cell.cameras["camera"].on, cell.targets["target"].on) == ("left", "right")
    assert is_camera_on_robot(cell, None) is None
    assert is_camera_on_robot(cell, None, None, "right") is False
    after, recording = import_file(tmp_path, make_record(False), Carriers(), "right")
    assert (after.cameras["camera"].on, after.targets["target"].on) == ("left", "right")
    assert [sorted(sample.robots) for sample in recording.samples] == [["left"]] * 3 + [["right"]] * 3
    with pytest.raises(InputError, match=r"no robot 'rihgt' \(did you mean 'right'\?\); there are: left, right"):
        import_file(tmp_path, first, Carriers("left", "rihgt"), None)
    with pytest.raises(InputError, match="camera 'camera' and target 'target' are both on 'left'"):
        import_file(tmp_path, first, Carriers("left", "left"), None)


def import_file(folder: Path, record: HandEyeRecord, carriers: Carriers, robot: str | None) -> tuple[Cell, Recording]:
    imported = hand_eye_of_file(folder, lambda _: record, carriers, robot, None, None)
    done = add_to_cell(folder, imported, lambda _, __: ())
    return done.cell, done.recording


def test_choice_of_several_cameras_is_requested(tmp_path: Path) -> None:
    """A name is needed if there are two cameras, or two robots."""
    cell = cell_in(tmp_path, cameras={"a": {"on": "arm"}, "b": {"on": "arm"}}, targets={"t": {"on": "world"}})
    with pytest.raises(InputError, match=r"which camera\? --camera is one of: a, b"):
        chosen_names(cell, None, None, None, True)
    assert chosen_names(cell, None, "b", None, True) == Names("arm", "b", "t")


def test_hand_eye_result_has_no_samples() -> None:
    """A result has no poses, images or sizes."""
    record = HandEyeRecord("a.calib", "a calibration", True)
    assert len(record.base_from_flange) == 0
    assert (record.camera_from_target, record.images, dict(record.lens)) == (None, (), {})


@pytest.mark.parametrize(("unknown", "is_guessed", "is_open"), [
    (None, True, True), (Unknown(), True, True), (Unknown("free", POSES[1]), False, False),
    (Unknown("fixed", POSES[1]), False, False),
])  # fmt: skip
def test_unknown_mount_gets_guess(unknown: Unknown | None, is_guessed: bool, is_open: bool) -> None:
    """The record's guess is used for an unknown mount; a stated one is kept.

    Without an estimate only a new mount is open.
    """
    assert ("guess" in _mount(unknown, POSES[0]).get("mount", {})) == is_guessed
    assert bool(_mount(unknown, POSES[0])) == is_open
    assert bool(_mount(unknown, None)) == (unknown is None)


def test_carrier_of_named_camera_is_used(tmp_path: Path) -> None:
    """The named camera determines the carrier; without a name only the user's statement counts."""
    cell = cell_in(tmp_path, cameras={"a": {"on": "arm"}, "b": {"on": "world"}}, targets={"t": {"on": "world"}})
    assert [is_camera_on_robot(cell, name) for name in ("a", "b", None)] == [True, False, None]
    assert [is_camera_on_robot(cell, None, on) for on in ("robot", "world", "arm")] == [True, False, True]
    assert [is_camera_on_robot(cell, "b", "arm", robot) for robot in (None, "arm", "other")] == [True, True, False]


def test_carrying_robot_is_chosen(tmp_path: Path) -> None:
    """The robot of the camera or of the target is chosen of two; if they are on the world a choice is requested."""
    things = {"cameras": {"cam": {"on": "left"}}, "targets": {"tag": {"on": "right"}}}
    cell = cell_in(tmp_path, reference="left", robots={"left": {}, "right": {}}, **things)
    assert chosen_names(cell, None, None, None, True).robot == "left"
    assert chosen_names(cell, None, None, None, False).robot == "right"
    assert chosen_names(cell, "right", None, None, True).robot == "right"
    still = cell_in(tmp_path, reference="left", robots={"left": {}, "right": {}}, cameras={"cam": {"on": "world"}})
    with pytest.raises(InputError, match=r"which robot\?"):
        chosen_names(still, None, None, "tag", True)
    with pytest.raises(InputError, match=r"which robot\?"):
        chosen_names(still, None, None, "tag", False)


def test_shape_of_target_is_kept(tmp_path: Path) -> None:
    """The file's shape is used only for a target without one."""
    shape = {"kind": "led"}
    cell = cell_in(tmp_path, cameras={"cam": {"on": "arm"}}, targets={"led": {"on": "world", "kind": "led"}})
    record = make_record(True, target=shape)
    assert "kind" not in imported_hand_eye(cell, record, Names("arm", "cam", "led")).cell["targets"]["led"]
    assert imported_hand_eye(cell, record, Names("arm", "cam", "new")).cell["targets"]["new"]["kind"] == "led"
    bare = cell_in(tmp_path, cameras={"cam": {"on": "arm"}}, targets={"tag": {"on": "world"}})
    assert imported_hand_eye(bare, record, Names("arm", "cam", "tag")).cell["targets"]["tag"]["kind"] == "led"


@pytest.mark.parametrize(("stated", "frame"), [({}, "camera_link"), ({"frame": "wrist_optical"}, "wrist_optical")])
def test_camera_frame_is_added_not_replaced(tmp_path: Path, stated: dict[str, str], frame: str) -> None:
    """The file's name for the camera's frame is used if the cell states none."""
    cell = cell_in(tmp_path, cameras={"wrist": {"on": "arm", **stated}}, targets={"tag": {"on": "world"}})
    names = chosen_names(cell, None, None, None, True)
    after, _ = import_record(tmp_path, cell, make_record(True, camera_frame="camera_link"), names)
    assert after.cameras["wrist"].frame == frame
