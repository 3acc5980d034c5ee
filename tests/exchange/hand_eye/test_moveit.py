"""MoveIt Calibration's files: the JSON of its solver's tests, and the YAML that its panel's code writes."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from basecal.errors import DatasetError, InputError
from basecal.exchange.hand_eye.moveit import is_joint_states, read_joint_states, read_moveit_samples
from basecal.geometry import SE3

DATA = Path(os.environ.get("BASECAL_DATA", Path(__file__).parents[4] / "shared" / "data"))
POSES = SE3.exp(np.random.default_rng(4).normal(size=(2, 3, 6)))


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def saved_samples() -> str:
    """What "Save samples" writes: a list of maps, each of two lists of 16 numbers, row by row."""
    text = ""
    for i in range(3):
        text += "-\n"
        for name, poses in (("effector_wrt_world", POSES[0]), ("object_wrt_sensor", POSES[1])):
            text += f"  {name}:\n" + "".join(f"    - {value!r}\n" for value in poses[i].matrix.ravel().tolist())
    return text


@pytest.mark.skipif(not DATA.is_dir(), reason="the project's shared data are not here")
def test_the_samples_of_its_solvers_tests() -> None:
    """Fifty pairs, and with the camera beside the robot the target holds still on the flange to some millimetres."""
    record = read_moveit_samples(DATA / "moveit_pose_samples" / "pose_samples.json", camera_on_robot=False)
    assert len(record.base_from_flange) == 50
    assert record.camera_from_target is not None
    raw = json.loads((DATA / "moveit_pose_samples" / "pose_samples.json").read_text())
    np.testing.assert_allclose(record.base_from_flange[7].matrix, raw[7][0], atol=1e-6)
    np.testing.assert_allclose(record.camera_from_target[7].matrix, raw[7][1], atol=1e-6)


def test_saved_samples(tmp_path: Path) -> None:
    """Both poses, to the last digit, whatever carries the camera: MoveIt inverts nothing in its file."""
    path = write(tmp_path, "samples.yaml", saved_samples())
    for on_robot in (True, False):
        record = read_moveit_samples(path, on_robot)
        assert record.camera_on_robot is on_robot
        np.testing.assert_allclose(record.base_from_flange.matrix, POSES[0].matrix, atol=1e-14)
        assert record.camera_from_target is not None
        np.testing.assert_allclose(record.camera_from_target.matrix, POSES[1].matrix, atol=1e-14)
    with pytest.raises(InputError, match=r"samples.yaml does not say .* Give --camera-on robot or --camera-on world"):
        read_moveit_samples(path, None)


def test_saved_joint_states(tmp_path: Path) -> None:
    """Names, and a row for each sample [rad]; not taken for samples."""
    text = "joint_names:\n  - a\n  - b\njoint_values:\n  -\n    - 0.1\n    - -1.5\n  - [0.2, -1.6]\n"
    path = write(tmp_path, "joints.yaml", text)
    assert is_joint_states(path)
    states = read_joint_states(path)
    assert states.names == ("a", "b")
    np.testing.assert_array_equal(states.joints_rad, [[0.1, -1.5], [0.2, -1.6]])
    assert not is_joint_states(write(tmp_path, "samples.yaml", saved_samples()))
    with pytest.raises(DatasetError, match=r"joints.yaml:6: joint_values\[1\]: has 1 numbers, expected 2"):
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
def test_what_are_no_samples_is_told(tmp_path: Path, text: str, message: str) -> None:
    """With the place and what was expected."""
    with pytest.raises(DatasetError, match=message):
        read_moveit_samples(write(tmp_path, "s.yaml", text), True)
