"""Tests of `basecal import moveit-samples`."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import read_cell, read_recording
from basecal.cell.format.yaml_text import yaml_text
from basecal.cli import main
from basecal.errors import DatasetError, InputError
from basecal.exchange.importers.moveit_samples import (
    JointStates,
    imported_joint_states,
    is_joint_states,
    read_joint_states,
    read_moveit_record,
)
from basecal.exchange.importing.imported import NO_CELL
from basecal.geometry import SE3
from cell_example import URDF

POSES = SE3.exp(np.random.default_rng(4).normal(size=(2, 3, 6)) * 0.3)
DATA = Path(os.environ.get("BASECAL_DATA", Path(__file__).parents[4] / "shared" / "data"))
WIDE_POSES = SE3.exp(np.random.default_rng(4).normal(size=(2, 3, 6)))


def write_samples(path: Path, unit_m: float = 1.0) -> str:
    """Write the output of the panel's "Save samples": for each sample two lists of 16 numbers, by rows."""
    text = ""
    for i in range(3):
        text += "-\n"
        for name, poses in zip(("effector_wrt_world", "object_wrt_sensor"), POSES, strict=True):
            text += f"  {name}:\n" + "".join(
                f"    - {value!r}\n"
                for value in SE3(poses[i].rotation, poses[i].translation / unit_m).matrix.ravel().tolist()
            )
    path.write_text(text)
    return str(path)


def test_moveit_samples_need_camera_carrier(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The samples do not state the camera's carrier, so it is requested; with it both poses of each are in a cell."""
    words = ["import", "moveit-samples", str(tmp_path / "c"), write_samples(tmp_path / "s.yaml")]
    assert main(words) == 3
    assert "Give --camera-on robot or --camera-on world" in capsys.readouterr().err
    assert main([*words, "--camera-on", "world", "--robot", "arm"]) == 0
    assert [camera.on for camera in read_cell(tmp_path / "c").cameras.values()] == ["world"]
    sample = read_recording(tmp_path / "c").samples[2]
    state, seen = sample.robots["arm"].base_from_flange, sample.observations[0]
    assert state is not None
    np.testing.assert_allclose(state.matrix, POSES[0, 2].matrix, atol=1e-12)
    np.testing.assert_allclose(seen.camera_from_target.matrix, POSES[1, 2].matrix, atol=1e-12)  # type: ignore[union-attr]


def test_moveit_samples_in_millimetres_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """MoveIt writes metres, and the message states this."""
    words = [
        "import",
        "moveit-samples",
        str(tmp_path / "c"),
        write_samples(tmp_path / "s.yaml", 1e-3),
        "--camera-on",
        "world",
    ]
    assert main(words) == 3
    assert "check that its lengths are metres" in capsys.readouterr().err


def test_joint_states_need_urdf(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without a robot that has a URDF they are refused, and no cell is made."""
    path = tmp_path / "joints.yaml"
    path.write_text("joint_names: [a, b]\njoint_values:\n  - [0.1, -1.5]\n")
    assert main(["import", "moveit-samples", str(tmp_path / "c"), str(path), "--robot", "arm"]) == 3
    assert "urdf" in capsys.readouterr().err.lower()
    assert not (tmp_path / "c").exists()


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def samples_yaml() -> str:
    """Return the output of "Save samples": a list of maps, each with two lists of 16 numbers, by rows."""
    text = ""
    for i in range(3):
        text += "-\n"
        for name, poses in (("effector_wrt_world", WIDE_POSES[0]), ("object_wrt_sensor", WIDE_POSES[1])):
            text += f"  {name}:\n" + "".join(f"    - {value!r}\n" for value in poses[i].matrix.ravel().tolist())
    return text


@pytest.mark.skipif(not DATA.is_dir(), reason="the project's shared data are not here")
def test_real_moveit_samples_are_read() -> None:
    """Fifty pairs are read.

    With the camera beside the robot the target stays fixed on the flange to some millimetres.
    """
    record = read_moveit_record(DATA / "moveit_pose_samples" / "pose_samples.json", camera_on_robot=False)
    assert len(record.base_from_flange) == 50
    assert record.camera_from_target is not None
    raw = json.loads((DATA / "moveit_pose_samples" / "pose_samples.json").read_text())
    np.testing.assert_allclose(record.base_from_flange[7].matrix, raw[7][0], atol=1e-6)
    np.testing.assert_allclose(record.camera_from_target[7].matrix, raw[7][1], atol=1e-6)


def test_moveit_samples_are_read_unchanged(tmp_path: Path) -> None:
    """Both poses are read to the last digit, whatever carries the camera, since MoveIt inverts none in its file."""
    path = write(tmp_path, "samples.yaml", samples_yaml())
    for on_robot in (True, False):
        record = read_moveit_record(path, on_robot)
        assert record.camera_on_robot is on_robot
        np.testing.assert_allclose(record.base_from_flange.matrix, WIDE_POSES[0].matrix, atol=1e-14)
        assert record.camera_from_target is not None
        np.testing.assert_allclose(record.camera_from_target.matrix, WIDE_POSES[1].matrix, atol=1e-14)
    with pytest.raises(InputError, match=r"samples.yaml does not say .* Give --camera-on robot or --camera-on world"):
        read_moveit_record(path, None)


def test_saved_joint_states_are_read(tmp_path: Path) -> None:
    """The file has names, and a row for each sample [rad]; it is not mistaken for samples."""
    text = "joint_names:\n  - a\n  - b\njoint_values:\n  -\n    - 0.1\n    - -1.5\n  - [0.2, -1.6]\n"
    path = write(tmp_path, "joints.yaml", text)
    assert is_joint_states(path)
    states = read_joint_states(path)
    assert states.names == ("a", "b")
    np.testing.assert_array_equal(states.joints_rad, [[0.1, -1.5], [0.2, -1.6]])
    assert not is_joint_states(write(tmp_path, "samples.yaml", samples_yaml()))
    with pytest.raises(DatasetError, match=r"joints.yaml:6: joint_values\[1\]: has 1 number, expected 2"):
        read_joint_states(
            write(
                tmp_path,
                "joints.yaml",
                text.replace("[0.2, -1.6]", "[0.2]").replace("  -\n    - 0.1\n    - -1.5\n", "  - [0.1, -1.5]\n"),
            )
        )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\n", "is a mapping, expected a list of samples"),
        ("- effector_wrt_world: [1, 2]\n", r"\[0\].effector_wrt_world: has 2 numbers, expected 16"),
        ("- effector_wrt_world: [" + "1, " * 15 + "1]\n", "not a rotation|last row"),
        ("- [[1], [2], [3]]\n", "has 3 entries; expected a list of effector_wrt_world"),
        ("- 1\n", "is 1, expected a mapping with 'effector_wrt_world'"),
    ],
)
def test_invalid_moveit_samples_are_reported(tmp_path: Path, text: str, message: str) -> None:
    """The error states the place and what was expected."""
    with pytest.raises(DatasetError, match=message):
        read_moveit_record(write(tmp_path, "s.yaml", text), True)


def test_joint_states_are_assigned_by_name(tmp_path: Path) -> None:
    """Columns are assigned to the joints of their names; a robot without a URDF, and other joint names, are errors."""
    (tmp_path / "arm.urdf").write_text(URDF)
    links = {"urdf": "arm.urdf", "base_link": "base", "flange_link": "tool0"}
    words = {"schema": "basecal/cell/1", "reference": "arm", "robots": {"arm": links}}
    (tmp_path / "cell.yaml").write_text(yaml_text(words))
    cell = read_cell(tmp_path)
    chain = cell.robots["arm"].chain
    assert chain is not None
    names = (*reversed(chain.joint_names), "gripper")
    rows = np.arange(2.0 * len(names)).reshape(2, -1) / 10
    imported = imported_joint_states(cell, JointStates(names, rows), "j.yaml", None)
    joints = imported.rows[1].robots["arm"].joints_rad
    assert joints is not None
    np.testing.assert_array_equal(joints, rows[1, :-1][::-1])
    with pytest.raises(InputError, match=r"joint states need a robot with a URDF in cell.yaml"):
        imported_joint_states(NO_CELL, JointStates(names, rows), "j.yaml", None)
    with pytest.raises(InputError, match=r"j.yaml: has joints gripper, the chain of 'arm' in its URDF .* not recorded"):
        imported_joint_states(cell, JointStates(("gripper",), rows[:, -1:]), "j.yaml", "arm")
