"""Tests of `basecal import arrays`."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.cell.files import read_cell, read_recording
from basecal.cli import main
from basecal.errors import DatasetError, InputError
from basecal.exchange.importers.arrays import read_record_of_arrays, record_of_arrays
from basecal.geometry import SE3

MOUNT, BASE = SE3.exp([0.03, -0.05, 0.06, 0.2, -0.4, 0.3]), SE3.exp([1.2, 0.1, 0.0, 0.0, 0.1, 2.5])
EYE, SEEN = (SE3.exp([0, 0, 0.5, 0, 0, 0] + 0.3 * np.random.default_rng(k).normal(size=(12, 6))) for k in range(2))
HAND = BASE.inverse() @ EYE @ MOUNT @ SEEN

ONE_ARM = {"gripper2base": MOUNT @ SEEN, "target2cam": SEEN}
POSES = SE3.exp(np.random.default_rng(0).normal(size=(3, 5, 6)))


def _save_poses(path: Path, **poses: SE3) -> None:
    arrays = {}
    for name, pose in poses.items():
        arrays[f"R_{name}"], arrays[f"t_{name}"] = pose.rotation, pose.translation
    np.savez(path, **arrays)


def test_archive_of_one_arm_becomes_cell(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An archive makes a cell of one arm, ready to be calibrated."""
    _save_poses(tmp_path / "poses.npz", gripper2base=MOUNT @ SEEN, target2cam=SEEN)
    assert main(["import", "arrays", str(tmp_path / "cell"), str(tmp_path / "poses.npz"), "--camera-on", "world"]) == 0
    message = capsys.readouterr().out
    assert "12 samples under OpenCV's names: R_gripper2base" in message
    cell = read_cell(tmp_path / "cell")
    assert set(cell.transforms) == {"hand_base_from_camera", "hand_flange_from_target"}


@pytest.mark.journey
def test_unit_option_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Millimetres read as metres are refused with the option that reads them."""
    in_mm = {name: SE3(pose.rotation, 1e3 * pose.translation) for name, pose in ONE_ARM.items()}
    _save_poses(tmp_path / "poses.npz", **in_mm)
    words = ["import", "arrays", str(tmp_path / "cell"), str(tmp_path / "poses.npz")]
    assert main(words) == 3
    assert "all lengths are read in m: check --unit, or convert arrays of another unit;" in capsys.readouterr().err
    assert main([*words, "--unit", "mm"]) == 0


@pytest.mark.journey
def test_two_arms_are_named(tmp_path: Path) -> None:
    """The poses of two arms are assigned to the named robots."""
    _save_poses(tmp_path / "poses.npz", eye_gripper2base=EYE, hand_gripper2base=HAND, target2cam=SEEN)
    names = ["--robot", "left", "--hand", "right"]
    assert main(["import", "arrays", str(tmp_path / "cell"), str(tmp_path / "poses.npz"), *names]) == 0
    cell = read_cell(tmp_path / "cell")
    assert "left_base_from_right_base" in cell.transforms
    state = read_recording(tmp_path / "cell", cell).samples[2].robots["right"]
    np.testing.assert_allclose(state.base_from_flange.matrix, HAND[2].matrix, atol=1e-9)


def test_list_in_place_of_arrays_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A list in place of arrays by name leaves no files behind."""
    (tmp_path / "poses.json").write_text("[1, 2]")
    assert main(["import", "arrays", str(tmp_path / "cell"), str(tmp_path / "poses.json")]) == 3
    assert "expected a mapping of arrays by OpenCV's names" in capsys.readouterr().err
    assert not (tmp_path / "cell").exists()


def _arrays(*names: str) -> dict[str, np.ndarray]:
    made = {}
    for name, pose in zip(names, POSES, strict=False):
        made[f"R_{name}"], made[f"t_{name}"] = pose.rotation, pose.translation[..., None]
    return made


def test_archive_in_millimetres_is_converted(tmp_path: Path) -> None:
    """An archive in millimetres gives its poses in metres."""
    arrays = _arrays("gripper2base", "target2cam")
    np.savez(tmp_path / "poses.npz", **{key: 1e3 * a if key[0] == "t" else a for key, a in arrays.items()})
    found = read_record_of_arrays(tmp_path / "poses.npz", None, 1e-3)
    np.testing.assert_allclose(found.base_from_flange.matrix, POSES[0].matrix, atol=1e-12)
    np.testing.assert_allclose(found.camera_from_target.matrix, POSES[1].matrix, atol=1e-12)


def test_json_of_inverted_poses_is_read(tmp_path: Path) -> None:
    """`base2gripper` is inverted, and `world2cam` is the target's pose."""
    data = {key: value.tolist() for key, value in _arrays("base2gripper", "world2cam").items()}
    (tmp_path / "poses.json").write_text(json.dumps(data))
    found = read_record_of_arrays(tmp_path / "poses.json", True, 1.0)
    np.testing.assert_allclose(found.base_from_flange.matrix, POSES[0].inverse().matrix, atol=1e-12)


def test_matrices_and_vectors_under_other_names_are_read() -> None:
    """4x4 matrices hold rotation and translation; `rvecs` and `tvecs` are the target's; rows of nine are matrices."""
    arrays = {"T_gripper2base": POSES[0].matrix, "rvecs": POSES[1].rotvec, "tvecs": POSES[1].translation}
    found = record_of_arrays(arrays, "test")
    np.testing.assert_allclose(found.base_from_flange.matrix, POSES[0].matrix, atol=1e-12)
    np.testing.assert_allclose(found.camera_from_target.matrix, POSES[1].matrix, atol=1e-12)
    flat = {**_arrays("gripper2base", "target2cam"), "R_target2cam": POSES[1].rotation.reshape(-1, 9)}
    np.testing.assert_allclose(record_of_arrays(flat, "test").camera_from_target.matrix, POSES[1].matrix, atol=1e-12)
    with pytest.raises(InputError, match=r"T_gripper2base has shape \(5, 3, 4\), expected \(n, 4, 4\)"):
        record_of_arrays({**arrays, "T_gripper2base": POSES[0].matrix[:, :3]}, "test")


@pytest.mark.parametrize("ending", ["yml", "xml", "json"])
@pytest.mark.parametrize("is_list", [False, True])
def test_opencv_file_storage_is_read(tmp_path: Path, ending: str, is_list: bool) -> None:
    """One matrix of all samples, or a list of one matrix each as C++ writes vectors of them, is read."""
    arrays = _arrays("gripper2base", "target2cam")
    storage = cv2.FileStorage(str(tmp_path / f"poses.{ending}"), cv2.FILE_STORAGE_WRITE)
    for key, values in arrays.items():
        if is_list:
            storage.startWriteStruct(key, cv2.FileNode_SEQ)
            for matrix in values:
                storage.write("", matrix)
            storage.endWriteStruct()
        else:
            storage.write(key, values)
    storage.release()
    found = read_record_of_arrays(tmp_path / f"poses.{ending}", None, 1.0)
    np.testing.assert_allclose(found.base_from_flange.matrix, POSES[0].matrix, atol=1e-9)
    np.testing.assert_allclose(found.camera_from_target.matrix, POSES[1].matrix, atol=1e-9)


def test_list_of_samples_is_read(tmp_path: Path) -> None:
    """Each sample is a mapping with the same names."""
    arrays = _arrays("gripper2base", "target2cam")
    samples = [{key: values[k].tolist() for key, values in arrays.items()} for k in range(5)]
    (tmp_path / "poses.json").write_text(json.dumps(samples))
    found = read_record_of_arrays(tmp_path / "poses.json", None, 1.0)
    np.testing.assert_allclose(found.camera_from_target.matrix, POSES[1].matrix, atol=1e-12)


def test_single_array_is_refused(tmp_path: Path) -> None:
    """A file of one array holds no names; the message lists the expected ones."""
    np.save(tmp_path / "poses.npy", POSES[0].rotation)
    with pytest.raises(InputError, match=r"poses\.npy: holds array, expected R_gripper2base, t_gripper2base, "):
        read_record_of_arrays(tmp_path / "poses.npy", None, 1.0)


def test_second_arm_carries_target() -> None:
    """The second of two arms carries the target."""
    found = record_of_arrays(_arrays("eye_gripper2base", "hand_gripper2base", "target2cam"), "test")
    recorded = found.base_from_flange, found.hand_base_from_flange, found.camera_from_target
    for pose, expected in zip(recorded, POSES, strict=True):
        np.testing.assert_allclose(pose.matrix, expected.matrix, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"R_target2cam": None}, "R_target2cam is not an array of numbers|R_target2cam has shape"),
        ({"R_target2cam": POSES[1].matrix}, r"R_target2cam has shape \(5, 4, 4\), expected \(n, 3, 3\) or \(n, 3\)"),
        ({"t_target2cam": POSES[1].translation[1:]}, "R_target2cam has 5 entries and t_target2cam 4"),
        ({"R_target2cam": POSES[1].rotation * [1, 1, -1]}, "R_target2cam is not a rotation"),
        ({"t_gripper2base": np.full((5, 3), np.nan)}, "t_gripper2base holds NaN"),
        ({"t_gripper2base": np.ma.masked_less(POSES[0].translation, 0)}, "t_gripper2base is a masked array"),
        ({"t_gripper2base": POSES[0].translation + 1j}, "t_gripper2base is a complex array, expected real"),
        ({"R_gripper2base": np.full((5, 3), 90.0)}, "R_gripper2base has a rotation vector of length 155.9, expected"),
        ({"R_gripper2base": [[1.0], [1.0, 2.0]]}, "R_gripper2base is not an array of numbers"),
        ({"t_gripper2base": [[10**400, 0, 0]]}, "t_gripper2base is not an array of numbers"),
    ],
)
def test_invalid_arrays_are_named(change: dict[str, object], message: str) -> None:
    """An array of a wrong shape, length or type is refused by its name."""
    with pytest.raises(InputError, match=message):
        record_of_arrays({**_arrays("gripper2base", "target2cam"), **change}, "test")


def test_unknown_array_names_are_refused() -> None:
    """The error lists the known names."""
    with pytest.raises(InputError, match="holds R_a, t_a, expected R_gripper2base, t_gripper2base, R_target2cam"):
        record_of_arrays(_arrays("a"), "test")


def test_empty_arrays_are_refused() -> None:
    """Arrays of length zero are reported, in any shape."""
    arrays = {name: each[:0] for name, each in _arrays("gripper2base", "target2cam").items()}
    with pytest.raises(InputError, match="R_gripper2base is empty, expected a pose for each sample"):
        record_of_arrays(arrays, "test")


def test_a_number_that_is_none_is_named_by_its_place() -> None:
    """The first pose that holds one, counted from 0."""
    arrays = {name: each.copy() for name, each in _arrays("gripper2base", "target2cam").items()}
    arrays["t_target2cam"][3, 1] = np.nan
    with pytest.raises(InputError, match="t_target2cam holds NaN or infinity in entry 3, counted from 0"):
        record_of_arrays(arrays, "test")


def test_file_error_has_file_name_once(tmp_path: Path) -> None:
    """The file name occurs once, also if the message begins with it."""
    path = tmp_path / "a.npz"
    bad = {name: each * np.nan for name, each in _arrays("gripper2base", "target2cam").items()}
    for arrays, words in ((bad, "R_gripper2base holds NaN or infinity"), ({"a": np.ones(3)}, "holds a, expected ")):
        np.savez(path, **arrays)
        with pytest.raises(DatasetError) as raised:
            read_record_of_arrays(path, True, 1.0)
        assert str(raised.value).startswith(f"{path}: {words}")


def test_equal_robot_and_target_poses_are_refused() -> None:
    """If the gripper's poses are given as the target's too, no calibration is possible."""
    arrays = _arrays("gripper2base", "target2cam")
    same = {f"{letter}_target2cam": arrays[f"{letter}_gripper2base"] for letter in "Rt"}
    with pytest.raises(InputError, match="gripper2base and target2cam are the same poses: one was given for both"):
        record_of_arrays({**arrays, **same}, "test")


def test_pose_counts_must_agree() -> None:
    """The error names each array of poses with its count."""
    fewer = SE3(POSES[1].rotation[1:], POSES[1].translation[1:])
    arrays = {**_arrays("gripper2base"), "R_target2cam": fewer.rotation, "t_target2cam": fewer.translation}
    with pytest.raises(InputError, match="R_gripper2base has 5, R_target2cam has 4: expected the same number"):
        record_of_arrays(arrays, "test")


@pytest.mark.parametrize("count", [0, 1])
def test_list_of_few_samples(tmp_path: Path, count: int) -> None:
    """One sample is accepted; none, and samples with different names, are refused."""
    path = tmp_path / "poses.json"
    arrays = {key: values[0].tolist() for key, values in _arrays("gripper2base", "target2cam").items()}
    path.write_text(json.dumps([arrays] * count))
    if count:
        np.testing.assert_allclose(
            read_record_of_arrays(path, None, 1.0).camera_from_target.matrix, POSES[1].matrix[:1]
        )
    else:
        with pytest.raises(DatasetError, match="expected R_gripper2base, t_gripper2base"):
            read_record_of_arrays(path, None, 1.0)
    path.write_text(json.dumps([arrays, {**arrays, "more": 1}]))
    with pytest.raises(DatasetError, match="expected a mapping of arrays by OpenCV's names"):
        read_record_of_arrays(path, None, 1.0)


@pytest.mark.parametrize(("length", "is_angle"), [(6.28, True), (6.29, False)])
def test_rotation_vectors_longer_than_turn_are_refused(length: float, is_angle: bool) -> None:
    """Longer vectors are degrees; the length counts, in any direction."""
    vectors = POSES[1].rotvec.copy()
    vectors[2] = length * np.array([-0.6, 0.0, 0.8])
    arrays = {**_arrays("gripper2base", "target2cam"), "R_target2cam": vectors}
    if is_angle:
        assert len(record_of_arrays(arrays, "test").camera_from_target) == 5
    else:
        with pytest.raises(InputError, match=r"R_target2cam has a rotation vector of length 6\.29, expected radians"):
            record_of_arrays(arrays, "test")


@pytest.mark.parametrize("shape", [(5, 3), (5, 1, 3), (5, 3, 1)])
def test_vectors_may_be_rows_or_columns(shape: tuple[int, ...]) -> None:
    """Vectors are accepted in the shapes of OpenCV; a single vector does not stand for several samples."""
    arrays = {**_arrays("gripper2base", "target2cam"), "R_target2cam": POSES[1].rotvec.reshape(shape)}
    np.testing.assert_allclose(record_of_arrays(arrays, "test").camera_from_target.matrix, POSES[1].matrix, atol=1e-12)
    with pytest.raises(InputError, match=r"R_target2cam has shape \(3,\), expected"):
        record_of_arrays({**arrays, "R_target2cam": POSES[1].rotvec[0]}, "test")


def test_camera_is_on_robot_by_default(tmp_path: Path) -> None:
    """The camera of two arms is always on the first; with one arm the user may state the world."""
    _save_poses(tmp_path / "a.npz", gripper2base=POSES[0], target2cam=POSES[1])
    for on_flag, on_robot in ((None, True), (True, True), (False, False)):
        assert read_record_of_arrays(tmp_path / "a.npz", on_flag, 1.0).camera_on_robot == on_robot
    assert record_of_arrays(_arrays("gripper2base", "target2cam"), "test").camera_on_robot
    two = _arrays("eye_gripper2base", "hand_gripper2base", "target2cam")
    assert record_of_arrays(two, "test", camera_on_robot=False).camera_on_robot
    for name in ("eye", "hand"):
        same = {f"{letter}_target2cam": two[f"{letter}_{name}_gripper2base"] for letter in "Rt"}
        with pytest.raises(InputError, match=f"{name}_gripper2base and target2cam are the same poses"):
            record_of_arrays({**two, **same}, "test")


@pytest.mark.parametrize("letter", ["T", "H"])
def test_matrix_names_start_with_t_or_h(letter: str) -> None:
    """The letters T and H are accepted before known names only."""
    arrays = {f"{letter}_gripper2base": POSES[0].matrix, f"{letter}_target2cam": POSES[1].matrix}
    np.testing.assert_allclose(record_of_arrays(arrays, "test").camera_from_target.matrix, POSES[1].matrix)
    with pytest.raises(InputError, match=f"holds {letter}_other, R_gripper2base"):
        record_of_arrays({f"{letter}_other": 1.0, f"{letter}_gripper2base": POSES[0].matrix}, "test")
