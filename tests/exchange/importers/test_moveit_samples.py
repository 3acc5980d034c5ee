"""`basecal import moveit-samples`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import read_cell, read_recording
from basecal.cli import main
from basecal.geometry import SE3

POSES = SE3.exp(np.random.default_rng(4).normal(size=(2, 3, 6)) * 0.3)


def saved(path: Path, unit_m: float = 1.0) -> str:
    """What "Save samples" of its panel writes: of each sample two lists of 16 numbers, row by row."""
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


def test_samples(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """They do not say what carries the camera, which is asked; told, both poses of each are in a cell."""
    words = ["import", "moveit-samples", str(tmp_path / "c"), saved(tmp_path / "s.yaml")]
    assert main(words) == 3
    assert "Give --camera-on robot or --camera-on world" in capsys.readouterr().err
    assert main([*words, "--camera-on", "world", "--robot", "arm"]) == 0
    assert [camera.on for camera in read_cell(tmp_path / "c").cameras.values()] == ["world"]
    sample = read_recording(tmp_path / "c").samples[2]
    state, seen = sample.robots["arm"].base_from_flange, sample.observations[0]
    assert state is not None
    np.testing.assert_allclose(state.matrix, POSES[0, 2].matrix, atol=1e-12)
    np.testing.assert_allclose(seen.camera_from_target.matrix, POSES[1, 2].matrix, atol=1e-12)  # type: ignore[union-attr]


def test_millimetres_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The program writes metres, and the message says so."""
    words = ["import", "moveit-samples", str(tmp_path / "c"), saved(tmp_path / "s.yaml", 1e-3), "--camera-on", "world"]
    assert main(words) == 3
    assert "check that its lengths are metres" in capsys.readouterr().err


def test_joint_states_need_a_urdf(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without a robot that has one they are refused, and nothing is made."""
    path = tmp_path / "joints.yaml"
    path.write_text("joint_names: [a, b]\njoint_values:\n  - [0.1, -1.5]\n")
    assert main(["import", "moveit-samples", str(tmp_path / "c"), str(path), "--robot", "arm"]) == 3
    assert "urdf" in capsys.readouterr().err.lower()
    assert not (tmp_path / "c").exists()
