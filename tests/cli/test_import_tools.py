"""`basecal import` of other programs' files, from a file to a cell that calibrates."""

from __future__ import annotations

import os
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.cell.files import read_calibration, read_cell, read_recording
from basecal.cell.results.calibration_file import latest_run
from basecal.cli import main
from basecal.geometry import SE3

DATA = Path(os.environ.get("BASECAL_DATA", Path(__file__).parents[3] / "shared" / "data"))
HAND_BASE_FROM_CAMERA = SE3.from_rpy([-2.2, 0.1, 0.3], [0.9, -0.2, 0.7])
FLANGE_FROM_TARGET = SE3.from_rpy([0.1, -0.2, 0.3], [0.02, 0.03, 0.1])
CAMERA_INFO = """\
image_width: {width}
image_height: 480
camera_name: c
camera_matrix: {{rows: 3, cols: 3, data: [600, 0, 320, 0, 601, 240, 0, 0, 1]}}
distortion_model: plumb_bob
distortion_coefficients: {{rows: 1, cols: 5, data: [0.1, -0.2, 0, 0, 0]}}
"""


def block(name: str, pose: SE3) -> str:
    t, q = pose.translation.tolist(), pose.quaternion.tolist()
    place = f"{{x: {t[0]!r}, y: {t[1]!r}, z: {t[2]!r}}}"
    return f"  {name}: {{translation: {place}, rotation: {{x: {q[0]!r}, y: {q[1]!r}, z: {q[2]!r}, w: {q[3]!r}}}}}\n"


def eye_on_base_samples(count: int) -> str:
    """What easy_handeye2 records of a camera beside a robot: the robot inverted, and nothing said of it."""
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


def test_easy_handeye_asks_what_nothing_tells(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Samples that do not say what the robot carries leave nothing behind; told, they make a cell, and say so."""
    (tmp_path / "run.samples").write_text(eye_on_base_samples(15))
    words = ["import", "easy-handeye", str(tmp_path / "cell"), str(tmp_path / "run.samples")]
    assert main(words) == 3
    assert "give --camera-on robot or --camera-on world" in capsys.readouterr().err
    assert not (tmp_path / "cell").exists()
    assert main([*words, "--camera-on", "world"]) == 0
    assert "turned back here" in capsys.readouterr().out


@pytest.mark.slow  # a calibration with all its checks
def test_easy_handeye_samples_calibrate(tmp_path: Path) -> None:
    """Eye-on-base samples calibrate to where the camera is, within three of the stated sigmas."""
    (tmp_path / "run_eob.samples").write_text(eye_on_base_samples(15))
    assert main(["import", "easy-handeye", str(tmp_path / "cell"), str(tmp_path / "run_eob.samples")]) == 0
    assert main(["calibrate", str(tmp_path / "cell")]) == 0
    run = latest_run(tmp_path / "cell")
    assert run is not None
    found = read_calibration(run / "calibration.json")["hand_base_from_camera"]
    miss = (found.mean.inverse() @ HAND_BASE_FROM_CAMERA).log()
    assert np.all(np.abs(miss) < 3 * np.sqrt(np.diag(found.covariance)))


def test_camera_info_into_a_cell_with_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It stands in cell.yaml, where what is written by hand stays; one of other pictures is told with both sizes."""
    cell = tmp_path / "cell"
    (cell / "recording" / "images" / "wrist").mkdir(parents=True)
    cv2.imwrite(str(cell / "recording" / "images" / "wrist" / "0.png"), np.zeros((480, 640), np.uint8))
    (cell / "recording" / "samples.jsonl").write_text('{"sample": 0, "images": {"wrist": "images/wrist/0.png"}}\n')
    (cell / "cell.yaml").write_text(
        "schema: basecal/cell/1\nreference: arm  # by the door\nrobots: {arm: {}}\ncameras:\n  wrist: {on: arm}\n"
    )
    for width in (640, 1280):
        (tmp_path / f"{width}.yaml").write_text(CAMERA_INFO.format(width=width))
    assert main(["import", "camera-info", str(cell), str(tmp_path / "1280.yaml"), "--camera", "wrist"]) == 3
    told = capsys.readouterr().err
    assert "1280.yaml is of 1280 x 480 px, recording/images/wrist/0.png has 640 x 480" in told
    assert main(["import", "camera-info", str(cell), str(tmp_path / "640.yaml"), "--camera", "wrist"]) == 0
    assert "written into cell.yaml: cameras.wrist.model" in capsys.readouterr().out
    lens = read_cell(cell).cameras["wrist"].intrinsics
    assert lens is not None
    assert lens.camera is not None
    np.testing.assert_array_equal(lens.camera.parameters, [600, 601, 320, 240, 0.1, -0.2, 0, 0, 0])
    assert "# by the door" in (cell / "cell.yaml").read_text()


KALIBR = """\
{name}:
  camera_model: pinhole
  distortion_coeffs: [0.1, -0.2, 0, 0]
  distortion_model: radtan
  intrinsics: [600, 601, 320, 240]
  resolution: [640, 480]
"""
CAMERAMODEL = """\
{ 'lensmodel': 'LENSMODEL_OPENCV4', 'intrinsics': [600, 601, 320, 240, 0.1, -0.2, 0, 0],
  'extrinsics': [0, 0, 0, 0, 0, 0], 'imagersize': [640, 480] }
"""
COLMAP = struct.pack("<QiiQQ8d", 1, 1, 4, 640, 480, 600, 601, 320.5, 240.5, 0.1, -0.2, 0, 0)
OPENCV = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\nK: [600., 0., 320., 0., 601., 240., 0., 0., 1.]\n"


@pytest.mark.parametrize(
    ("kind", "name", "content"),
    [
        ("camera-info", "a.yaml", CAMERA_INFO.format(width=640)),
        ("kalibr", "a.yaml", KALIBR.format(name="cam0")),
        ("opencv", "a.yml", OPENCV + "D: [0.1, -0.2, 0., 0.]\n"),
        ("colmap", "cameras.bin", COLMAP),
        ("mrcal", "a.cameramodel", CAMERAMODEL),
    ],
)
def test_every_program_tells_the_same_lens(tmp_path: Path, kind: str, name: str, content: str | bytes) -> None:
    """One lens, as five programs write it, is the same in a new cell."""
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert main(["import", kind, str(tmp_path / "c"), str(path), "--camera", "wrist", "--on", "left"]) == 0
    camera = read_cell(tmp_path / "c").cameras["wrist"]
    assert (camera.on, camera.size_px) == ("left", (640, 480))
    assert camera.intrinsics is not None
    assert camera.intrinsics.camera is not None
    np.testing.assert_array_equal(camera.intrinsics.camera.parameters[:8], [600, 601, 320, 240, 0.1, -0.2, 0, 0])


def test_kalibrs_choices(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of several cameras one is chosen by its name in the file; a target goes into the same cell."""
    (tmp_path / "chain.yaml").write_text(KALIBR.format(name="cam0") + KALIBR.format(name="cam1"))
    cell = str(tmp_path / "c")
    words = ["import", "kalibr", cell, str(tmp_path / "chain.yaml"), "--camera", "wrist", "--on", "left"]
    assert main(words) == 3
    assert "has cam0, cam1: say which one by --camera-of-file" in capsys.readouterr().err
    assert main([*words, "--camera-of-file", "cam1"]) == 0
    (tmp_path / "t.yaml").write_text(
        "target_type: 'aprilgrid'\ntagCols: 6\ntagRows: 5\ntagSize: 0.088\ntagSpacing: 0.3\n"
    )
    assert main(["import", "kalibr", cell, str(tmp_path / "t.yaml"), "--target", "grid", "--on", "world"]) == 0
    target = read_cell(cell).targets["grid"].target
    assert target is not None
    assert dict(target.options)["tags"] == [6, 5]


def test_opencvs_size_by_option(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An archive has no size: the option gives it; it does not overrule a file's."""
    np.savez(tmp_path / "l.npz", mtx=[[600, 0, 320], [0, 601, 240], [0, 0, 1]], dist=[0.1, 0, 0, 0, 0])
    words = ["import", "opencv", str(tmp_path / "c"), "--size-px", "640", "480"]
    assert main([*words, str(tmp_path / "l.npz")]) == 0
    assert read_cell(tmp_path / "c").cameras["camera"].size_px == (640, 480)
    (tmp_path / "a.yml").write_text(OPENCV.replace("640", "1280"))
    assert main([*words, str(tmp_path / "a.yml")]) == 3
    assert "a.yml is of 1280 x 480 px: leave --size-px away" in capsys.readouterr().err


@pytest.mark.skipif(not DATA.is_dir(), reason="the project's shared data are not here")
def test_a_data_set_of_robot_cal_tools(tmp_path: Path) -> None:
    """Poses and pictures of a real set, laid out again as robot_cal_tools has them, come back as they were recorded."""
    real = read_recording(DATA / "rct_10x10")
    (tmp_path / "poses").mkdir()
    listing = ""
    for sample in real.samples:
        pose = sample.robots["arm"].base_from_flange
        assert pose is not None
        values = zip(("x", "y", "z", "qx", "qy", "qz", "qw"), [*pose.translation, *pose.quaternion], strict=True)
        (tmp_path / "poses" / f"{sample.sample}.yaml").write_text("".join(f"{k}: {float(v)!r}\n" for k, v in values))
        picture = DATA / "rct_10x10" / sample.images["cam"]
        listing += f"- image: {os.path.relpath(picture, tmp_path)}\n  pose: poses/{sample.sample}.yaml\n"
    (tmp_path / "cal_data.yaml").write_text(listing)
    (tmp_path / "target.yaml").write_text(
        "target_finder: {type: ModifiedCircleGridTargetFinder, rows: 10, cols: 10, spacing: 0.0254}\n"
    )
    (tmp_path / "lens.yaml").write_text("intrinsics: {fx: 550.0, fy: 550.0, cx: 320.0, cy: 240.0}\n")
    words = ["import", "robot-cal-tools", str(tmp_path / "c"), str(tmp_path / "cal_data.yaml"), "--camera-on", "robot"]
    assert (
        main([*words, "--intrinsics", str(tmp_path / "lens.yaml"), "--target-file", str(tmp_path / "target.yaml")]) == 0
    )
    cell, recording = read_cell(tmp_path / "c"), read_recording(tmp_path / "c")
    assert cell.targets["target"].target is not None
    assert len(recording.samples) == len(real.samples)
    for got, want in zip(recording.samples, real.samples, strict=True):
        here, there = got.robots["eye"].base_from_flange, want.robots["arm"].base_from_flange
        assert here is not None
        assert there is not None
        np.testing.assert_allclose(here.matrix, there.matrix, atol=1e-12)
        assert (tmp_path / "c" / got.images["camera"]).stat().st_size > 0


KINDS = ("easy-handeye", "moveit-samples", "industrial-calibration", "robot-cal-tools")
LENSES = ("camera-info", "kalibr", "opencv", "colmap", "mrcal")


def test_each_is_documented() -> None:
    """The page of other programs' files has every command."""
    page = (Path(__file__).parents[2] / "docs" / "importing_tools.md").read_text(encoding="utf-8")
    assert [kind for kind in (*KINDS, *LENSES) if f"`basecal import {kind}" not in page] == []
