"""`basecal import easy-handeye`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import read_calibration
from basecal.cell.results.calibration_file import latest_run
from basecal.cli import main
from basecal.geometry import SE3

HAND_BASE_FROM_CAMERA = SE3.from_rpy([-2.2, 0.1, 0.3], [0.9, -0.2, 0.7])
FLANGE_FROM_TARGET = SE3.from_rpy([0.1, -0.2, 0.3], [0.02, 0.03, 0.1])


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
