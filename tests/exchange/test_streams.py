"""Files of all robots and of a target at once, as `import poses` and `import pixels` read them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import read_cell, read_recording
from basecal.cli import main
from pose_files import drawn, options, pose_files, stack


@pytest.fixture
def files(tmp_path: Path) -> dict[str, str]:
    """Text files of four poses for each stream."""
    return pose_files(tmp_path)


def test_import_writes_what_the_files_say(tmp_path: Path, files: dict[str, str]) -> None:
    """The recording holds the poses of the files in metres, and the new cell has everything free."""
    assert main(["import", "poses", str(tmp_path / "c"), *options(files), "--length-unit", "mm"]) == 0
    recording, cell = read_recording(tmp_path / "c"), read_cell(tmp_path / "c")
    assert list(cell.transforms) == ["eye_base_from_hand_base", "eye_flange_from_camera", "hand_flange_from_target"]
    sample = recording.samples[2]
    for seed, pose in enumerate(
        [
            sample.robots["eye"].base_from_flange,
            sample.robots["hand"].base_from_flange,
            sample.observations[0].camera_from_target,
        ]
    ):
        expected = drawn(4, seed)[2]
        np.testing.assert_allclose(pose.rotation, expected.rotation, atol=1e-12)
        np.testing.assert_allclose(pose.translation, expected.translation / 1000, atol=1e-12)


def test_import_inverts_what_is_named(tmp_path: Path, files: dict[str, str]) -> None:
    """`--invert` turns the streams named round, and only those."""
    words = ["--length-unit", "m", "--invert", "camera-from-target", "hand-base-from-flange"]
    assert main(["import", "poses", str(tmp_path / "c"), *options(files), *words]) == 0
    sample = read_recording(tmp_path / "c").samples[0]
    turned = [sample.robots["hand"].base_from_flange, sample.observations[0].camera_from_target]
    for seed, pose in zip((1, 2), turned, strict=True):
        np.testing.assert_allclose((pose @ drawn(4, seed)[0]).matrix, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(sample.robots["eye"].base_from_flange.matrix, drawn(4, 0)[0].matrix, atol=1e-12)


@pytest.mark.parametrize(
    ("absent", "transforms"),
    [
        ("hand-base-from-flange", ["eye_flange_from_camera", "eye_base_from_target"]),
        ("eye-base-from-flange", ["hand_base_from_camera", "hand_flange_from_target"]),
    ],
)
def test_import_of_one_robot(tmp_path: Path, files: dict[str, str], absent: str, transforms: list[str]) -> None:
    """Without the hand's file the target stands on the world; without the eye's file the camera does."""
    del files[absent]
    assert main(["import", "poses", str(tmp_path / "c"), *options(files), "--length-unit", "m"]) == 0
    assert list(read_cell(tmp_path / "c").transforms) == transforms
    assert len(read_recording(tmp_path / "c").samples) == 4


def test_import_into_a_described_cell(
    tmp_path: Path, files: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    """A cell that is there keeps its file and gives the names; files that do not fit it are refused."""
    folder = str(tmp_path / "c")
    main(["new", folder, "--robots", "1", "--target", "pose"])
    text = Path(folder, "cell.yaml").read_text()
    base = ["import", "poses", folder, "--length-unit", "m"]
    assert main([*base, *options(files)]) == 3
    assert "--hand-base-from-flange belongs to no robot" in capsys.readouterr().err
    seen = ["--camera-from-target", files["camera-from-target"]]
    assert main([*base, *seen]) == 3
    assert "give its poses by --eye-base-from-flange" in capsys.readouterr().err
    eye = ["--eye-base-from-flange", files["eye-base-from-flange"]]
    assert main([*base, *seen, *eye, "--camera", "cam"]) == 3
    assert "no 'cam' (did you mean 'camera'?)" in capsys.readouterr().err
    assert main([*base, *seen, *eye, "--invert", "hand-base-from-flange"]) == 3
    assert "no file is given" in capsys.readouterr().err
    assert main([*base, *seen, *eye]) == 0
    assert Path(folder, "cell.yaml").read_text() == text
    assert len(read_recording(folder).samples) == 4


def test_failed_import_leaves_nothing(
    tmp_path: Path, files: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    """Files that differ in length are refused by name, and no cell is begun."""
    files["hand-base-from-flange"] = stack(tmp_path / "short.txt", drawn(3, 0))
    assert main(["import", "poses", str(tmp_path / "c"), *options(files), "--length-unit", "m"]) == 3
    assert "short.txt holds 3" in capsys.readouterr().err
    assert not (tmp_path / "c").exists()
