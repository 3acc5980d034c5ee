"""Tests of `basecal import easy-handeye`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import read_calibration
from basecal.cell.results.calibration_file import latest_run
from basecal.cli import main
from basecal.errors import DatasetError
from basecal.exchange.importers.easy_handeye import read_easy_handeye_record
from basecal.geometry import SE3

HAND_BASE_FROM_CAMERA = SE3.from_rpy([-2.2, 0.1, 0.3], [0.9, -0.2, 0.7])
FLANGE_FROM_TARGET = SE3.from_rpy([0.1, -0.2, 0.3], [0.02, 0.03, 0.1])
CHANCE = np.random.default_rng(12)
BASE_FROM_FLANGE = SE3.exp(CHANCE.normal(size=(4, 6)) * [0.3, 0.3, 0.3, 1, 1, 1])
CAMERA_FROM_TARGET = SE3.exp(CHANCE.normal(size=(4, 6)) * [0.3, 0.3, 0.3, 1, 1, 1])


def block(name: str, pose: SE3) -> str:
    t, q = pose.translation.tolist(), pose.quaternion.tolist()
    place = f"{{x: {t[0]!r}, y: {t[1]!r}, z: {t[2]!r}}}"
    return f"  {name}: {{translation: {place}, rotation: {{x: {q[0]!r}, y: {q[1]!r}, z: {q[2]!r}, w: {q[3]!r}}}}}\n"


def eye_on_base_samples(count: int) -> str:
    """Return easy_handeye2's samples of a camera beside a robot: robot poses inverted, without a statement of it."""
    chance = np.random.default_rng(2)
    tangents = chance.normal(size=(count, 6)) * [0.15, 0.15, 0.15, 0.6, 0.6, 0.6]
    reach = SE3.from_rpy([np.pi, 0, 0], [0.5, 0, 0.4])
    text = "parameters: {name: '', calibration_type: ''}\nsamples:\n"
    for i in range(count):
        base_from_flange = reach @ SE3.exp(tangents[i])
        camera_from_base = HAND_BASE_FROM_CAMERA.inverse()
        camera_from_target = camera_from_base @ base_from_flange @ FLANGE_FROM_TARGET
        seen = camera_from_target @ SE3.exp(chance.normal(size=6) * [*[2e-4] * 3, *[5e-4] * 3])
        text += "-" + block("robot", base_from_flange.inverse())[1:] + block("tracking", seen)
    return text


@pytest.mark.journey
def test_unknown_camera_carrier_is_requested(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Samples without the camera's carrier leave no files behind.

    With the option they make a cell and report the inversion.
    """
    (tmp_path / "run.samples").write_text(eye_on_base_samples(15))
    words = ["import", "easy-handeye", str(tmp_path / "cell"), str(tmp_path / "run.samples")]
    assert main(words) == 3
    assert "give --camera-on robot or --camera-on world" in capsys.readouterr().err
    assert not (tmp_path / "cell").exists()
    assert main([*words, "--camera-on", "world"]) == 0
    assert "inverted here" in capsys.readouterr().out


@pytest.mark.slow  # a calibration with all its checks
def test_eye_on_base_samples_calibrate(tmp_path: Path) -> None:
    """Eye-on-base samples calibrate to the camera's pose within three of the stated sigmas."""
    (tmp_path / "run_eob.samples").write_text(eye_on_base_samples(15))
    assert main(["import", "easy-handeye", str(tmp_path / "cell"), str(tmp_path / "run_eob.samples")]) == 0
    assert main(["calibrate", str(tmp_path / "cell")]) == 0
    run = latest_run(tmp_path / "cell")
    assert run is not None
    found = read_calibration(run / "calibration.json")["hand_base_from_camera"]
    miss = (found.mean.inverse() @ HAND_BASE_FROM_CAMERA).log()
    assert np.all(np.abs(miss) < 3 * np.sqrt(np.diag(found.covariance)))


def transform(pose: SE3, indent: str) -> str:
    lines = [
        "translation:",
        *(f"  {axis}: {value!r}" for axis, value in zip("xyz", pose.translation.tolist(), strict=True)),
    ]
    lines += [
        "rotation:",
        *(f"  {axis}: {value!r}" for axis, value in zip("xyzw", pose.quaternion.tolist(), strict=True)),
    ]
    return "".join(f"{indent}{line}\n" for line in lines)


def samples_text(robot: SE3, tracking: SE3, kind: str = "", frames: Sequence[str] = ("", "")) -> str:
    """A `.samples` of easy_handeye2: its SampleList, whose parameters its sampler leaves empty."""
    text = f"""\
parameters:
  name: ''
  calibration_type: '{kind}'
  robot_base_frame: '{frames[0]}'
  robot_effector_frame: '{frames[1]}'
  tracking_base_frame: ''
  tracking_marker_frame: ''
  freehand_robot_movement: false
  move_group_namespace: /
  move_group: manipulator
samples:
"""
    for i in range(len(robot)):
        text += "- robot:\n" + transform(robot[i], "    ") + "  tracking:\n" + transform(tracking[i], "    ")
    return text


def calib_text(kind: str, camera: SE3) -> str:
    """A `.calib` of easy_handeye2: its HandeyeCalibration."""
    return f"""\
parameters:
  name: arm
  calibration_type: {kind}
  robot_base_frame: base_link
  robot_effector_frame: tool0
  tracking_base_frame: camera
  tracking_marker_frame: marker
  freehand_robot_movement: true
  move_group_namespace: /
  move_group: manipulator
transform:
{transform(camera, "  ")}"""


def ros1_text(on_hand: bool, camera: SE3) -> str:
    """A calibration of easy_handeye: its dictionary, by PyYAML."""
    t, q = camera.translation.tolist(), camera.quaternion.tolist()
    return f"""\
parameters:
  eye_on_hand: {str(on_hand).lower()}
  freehand_robot_movement: false
  move_group: manipulator
  move_group_namespace: /
  namespace: /ur5_kinect/
  robot_base_frame: /base_link
  robot_effector_frame: tool0
  tracking_base_frame: camera_link
  tracking_marker_frame: camera_marker
transformation:
  qw: {q[3]!r}
  qx: {q[0]!r}
  qy: {q[1]!r}
  qz: {q[2]!r}
  x: {t[0]!r}
  y: {t[1]!r}
  z: {t[2]!r}
"""


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_eye_in_hand_samples_are_read_unchanged(tmp_path: Path) -> None:
    """`robot` is base_from_flange and `tracking` is camera_from_target, to the last digit."""
    text = samples_text(BASE_FROM_FLANGE, CAMERA_FROM_TARGET, "eye_in_hand", ("base_link", "/tool0"))
    record = read_easy_handeye_record(write(tmp_path, "a.samples", text))
    assert record.camera_on_robot
    np.testing.assert_allclose(record.base_from_flange.matrix, BASE_FROM_FLANGE.matrix, atol=1e-15)
    assert record.camera_from_target is not None
    np.testing.assert_allclose(record.camera_from_target.matrix, CAMERA_FROM_TARGET.matrix, atol=1e-15)
    assert dict(record.frames) == {"base": "base_link", "flange": "tool0"}
    assert "turned back" not in record.what


def test_eye_on_base_robot_poses_are_inverted(tmp_path: Path) -> None:
    """For an eye on the base `robot` is flange_from_base; it is inverted to base_from_flange, and this is reported."""
    text = samples_text(BASE_FROM_FLANGE.inverse(), CAMERA_FROM_TARGET, "eye_on_base")
    record = read_easy_handeye_record(write(tmp_path, "a.samples", text))
    assert not record.camera_on_robot
    np.testing.assert_allclose(record.base_from_flange.matrix, BASE_FROM_FLANGE.matrix, atol=1e-14)
    assert "written as flange_from_base and inverted here" in record.what
    assert "calibration_type is eye_on_base" in record.what


def test_camera_carrier_is_found_in_several_places(tmp_path: Path) -> None:
    """The carrier comes from the samples, else the user, else the calibration beside them, else the file name.

    Otherwise it is requested.
    """
    text = samples_text(BASE_FROM_FLANGE, CAMERA_FROM_TARGET)
    path = write(tmp_path, "run.samples", text)
    with pytest.raises(
        DatasetError, match=r"run.samples:1: does not say .* give --camera-on robot or --camera-on world"
    ):
        read_easy_handeye_record(path)
    assert not read_easy_handeye_record(path, camera_on_robot=False).camera_on_robot
    write(tmp_path, "run.calib", calib_text("eye_on_base", BASE_FROM_FLANGE[0]))
    from_calib = read_easy_handeye_record(path)
    assert not from_calib.camera_on_robot
    assert "in run.calib" in from_calib.what
    for name, on_robot in (("ur5-eob.samples", False), ("my_eih_calib.samples", True), ("geobase.samples", None)):
        named = write(tmp_path, name, text)
        if on_robot is None:
            with pytest.raises(DatasetError, match="does not say"):
                read_easy_handeye_record(named)
        else:
            assert read_easy_handeye_record(named).camera_on_robot is on_robot


def test_contradicting_carrier_option_is_refused(tmp_path: Path) -> None:
    """The option does not overrule the file."""
    path = write(tmp_path, "a.samples", samples_text(BASE_FROM_FLANGE, CAMERA_FROM_TARGET, "eye_in_hand"))
    with pytest.raises(DatasetError, match="calibration_type is eye_in_hand, which contradicts --camera-on"):
        read_easy_handeye_record(path, camera_on_robot=False)


@pytest.mark.parametrize("on_robot", [True, False])
def test_calibrations_of_both_versions_are_read(tmp_path: Path, on_robot: bool) -> None:
    """`.calib` of the second version and `.yaml` of the first give the camera's pose in the flange or in the base."""
    camera = BASE_FROM_FLANGE[1]
    kind = "eye_in_hand" if on_robot else "eye_on_base"
    first = read_easy_handeye_record(write(tmp_path, "one.yaml", ros1_text(on_robot, camera)))
    second = read_easy_handeye_record(write(tmp_path, "two.calib", calib_text(kind, camera)))
    for record in (first, second):
        assert record.camera_on_robot is on_robot
        assert record.camera_mount is not None
        np.testing.assert_allclose(record.camera_mount.matrix, camera.matrix, atol=1e-14)
        assert dict(record.frames) == {"base": "base_link", "flange": "tool0"}
        assert ("flange_from_camera" if on_robot else "base_from_camera") in record.what
    oldest = ros1_text(on_robot, camera).replace("parameters:\n", "").replace("\n  ", "\n").lstrip()
    oldest = oldest.replace("transformation:\nqw", "transformation:\n  qw").replace("\nq", "\n  q")
    oldest = oldest.replace("\nx:", "\n  x:").replace("\ny:", "\n  y:").replace("\nz:", "\n  z:")
    assert read_easy_handeye_record(write(tmp_path, "old.yaml", oldest)).camera_on_robot is on_robot


@pytest.mark.parametrize("inner", ["", "  transforms:\n"])
def test_ros_1_service_answers_are_read(tmp_path: Path, inner: str) -> None:
    """`rosservice call ... get_sample_list` gives two lists side by side, in the oldest versions one level deeper."""
    lists = ""
    for name, poses in (
        ("hand_world_samples", BASE_FROM_FLANGE.inverse()),
        ("camera_marker_samples", CAMERA_FROM_TARGET),
    ):
        lists += f"  {name}:\n" + (f"  {inner}" if inner else "")
        lists += "".join("    - \n" + transform(poses[i], "      ") for i in range(len(poses)))
    record = read_easy_handeye_record(write(tmp_path, "answer.yaml", "samples: \n" + lists), camera_on_robot=False)
    np.testing.assert_allclose(record.base_from_flange.matrix, BASE_FROM_FLANGE.matrix, atol=1e-14)
    assert record.camera_from_target is not None
    np.testing.assert_allclose(record.camera_from_target.matrix, CAMERA_FROM_TARGET.matrix, atol=1e-14)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("tracking:", "trakking:", r"a.samples:12: samples\[0\]: has no tracking or optical"),
        ("    rotation:\n      x: ", "    rotation:\n      x: 7", r"samples\[0\].robot: quaternion has norm"),
        (
            "eye_in_hand",
            "eye_in_eye",
            ":3: parameters.calibration_type: is 'eye_in_eye', expected one of eye_in_hand",
        ),
        ("samples:", "sample:", "holds parameters, sample, expected samples, hand_world_samples, transform"),
        ("x: ", "x: much ", "expected a number"),
    ],
)
def test_invalid_handeye_files_are_reported(tmp_path: Path, old: str, new: str, message: str) -> None:
    """The error has path, line and field."""
    text = samples_text(BASE_FROM_FLANGE, CAMERA_FROM_TARGET, "eye_in_hand").replace(old, new)
    with pytest.raises(DatasetError, match=message):
        read_easy_handeye_record(write(tmp_path, "a.samples", text))


def test_lists_of_unequal_length_are_refused(tmp_path: Path) -> None:
    """A truncated service answer has lists of unequal length."""
    one = "- \n" + transform(BASE_FROM_FLANGE[0], "  ")
    text = f"hand_world_samples:\n{one}{one}camera_marker_samples:\n{one}"
    with pytest.raises(DatasetError, match="2 hand_world_samples and 1 camera_marker_samples"):
        read_easy_handeye_record(write(tmp_path, "a.yaml", text), camera_on_robot=True)
