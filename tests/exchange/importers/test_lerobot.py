"""`basecal import lerobot`."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from tests.exchange.test_lerobot import DEGREES, dataset, names_of

from basecal.cell.files import read_cell, read_recording
from basecal.cli import main
from basecal.exchange.urdf import chain_urdf
from basecal.kinematics import SerialChain

pytest.importorskip("pyarrow")


def test_a_dataset_makes_a_cell(tmp_path: Path, arm: SerialChain, capsys: pytest.CaptureFixture[str]) -> None:
    """Joints in radians with the URDF beside them; in the wrong unit they are refused."""
    (tmp_path / "arm.urdf").write_text(chain_urdf(arm, "base", "tool"))
    data = dataset(tmp_path / "d", names_of(arm))
    base = ["import", "lerobot", str(tmp_path / "c"), str(data), "--robot", "left", "--every-s", "0"]
    base += ["--urdf", str(tmp_path / "arm.urdf"), "--base-link", "base", "--flange-link", "tool"]
    assert main([*base, "--unit", "rad"]) == 3
    assert "nothing is imported; check --unit" in capsys.readouterr().err
    assert main([*base, "--unit", "deg"]) == 0
    assert "3 of 3 frames of episode 0: joints of 'left' in deg" in capsys.readouterr().out
    found = [sample.robots["left"].joints_rad for sample in read_recording(tmp_path / "c").samples]
    np.testing.assert_allclose(np.degrees(found), DEGREES[:, :6], atol=1e-9)
    assert main([*base, "--unit", "deg", "--calibration", "x.json"]) == 2


def test_motors_taken_in_order_are_named(tmp_path: Path, arm: SerialChain, capsys: pytest.CaptureFixture[str]) -> None:
    """Of motors with other names than the joints it is said which is which: nobody else can see a wrong order."""
    (tmp_path / "arm.urdf").write_text(chain_urdf(arm, "base", "tool"))
    data = dataset(tmp_path / "d", [*"uvwxyz", "gripper"])
    words = ["import", "lerobot", str(tmp_path / "c"), str(data), "--robot", "left", "--unit", "deg"]
    words += ["--urdf", str(tmp_path / "arm.urdf"), "--base-link", "base", "--flange-link", "tool"]
    assert main(words) == 0
    pairs = ", ".join(f"{joint} from {motor}" for joint, motor in zip(arm.joint_names, "uvwxyz", strict=True))
    assert f"joints of 'left' in deg: {pairs}\n" in capsys.readouterr().out


def two_arms(folder: Path, arm: SerialChain, rest: int = 8) -> Path:
    """An episode of two arms with a film of each one's wrist, 60 frames at 30 Hz; the arms rest up to a frame."""
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    names = [f"{side}_{name}.pos" for side in ("left", "right") for name in (*arm.joint_names, "gripper")]
    films = [f"observation.images.{side}_wrist" for side in ("left", "right")]
    features = {"observation.state": {"names": names}, **{film: {"dtype": "video"} for film in films}}
    (folder / "meta").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps({"features": features}))
    moved = np.maximum(np.arange(60) - float(rest), 0)[:, None] + np.concatenate([DEGREES[0], DEGREES[1]])
    rows = [
        {"observation.state": [float(v) for v in row], "timestamp": k / 30, "episode_index": 0}
        for k, row in enumerate(moved)
    ]
    table = folder / "data" / "chunk-000" / "episode_000000.parquet"
    table.parent.mkdir(parents=True)
    parquet.write_table(pyarrow.Table.from_pylist(rows), table)
    for film in films:
        place = folder / "videos" / "chunk-000" / film / "episode_000000.mp4"
        place.parent.mkdir(parents=True)
        shutil.copy(Path(__file__).parents[2] / "data" / "film_av1.mp4", place)
    return folder


def test_two_arms_with_the_films_of_their_wrists(
    tmp_path: Path, arm: SerialChain, capsys: pytest.CaptureFixture[str]
) -> None:
    """Both arms and both cameras join the same samples, at the frames in which the arms moved least."""
    (tmp_path / "arm.urdf").write_text(chain_urdf(arm, "base", "tool"))
    data, cell = two_arms(tmp_path / "d", arm), tmp_path / "c"
    for side in ("left", "right"):
        words = ["import", "lerobot", str(cell), str(data), "--robot", side, "--unit", "deg", "--motors", f"{side}_*"]
        words += ["--urdf", str(tmp_path / "arm.urdf"), "--base-link", "base", "--flange-link", "tool"]
        words += ["--camera", f"{side}_eye"]
        assert main(words) == 3
        assert "has the films left_wrist, right_wrist: say which one by --film" in capsys.readouterr().err
        assert main([*words, "--film", f"{side}_wrist"]) == 0
        assert (
            f"joints of '{side}' in deg: {', '.join(arm.joint_names)}, with what '{side}_eye' saw"
            in capsys.readouterr().out
        )
    found, samples = read_cell(cell), read_recording(cell).samples
    assert {name: (camera.on, camera.size_px) for name, camera in found.cameras.items()} == {
        "left_eye": ("left", (64, 48)),
        "right_eye": ("right", (64, 48)),
    }
    assert [sorted(sample.images) for sample in samples] == [["left_eye", "right_eye"]] * 2
    np.testing.assert_allclose(np.degrees(samples[0].robots["right"].joints_rad), DEGREES[1, :6], atol=1e-9)
    assert not list(tmp_path.glob(".import-*"))


def test_arm_without_a_camera_joins_the_samples_of_the_other(
    tmp_path: Path, arm: SerialChain, capsys: pytest.CaptureFixture[str]
) -> None:
    """A camera on one arm and a board on the other, each arm in a dataset of its own: frames follow the samples."""
    (tmp_path / "arm.urdf").write_text(chain_urdf(arm, "base", "tool"))
    one, other, cell = two_arms(tmp_path / "one", arm), two_arms(tmp_path / "other", arm, rest=40), tmp_path / "c"
    base = ["--unit", "deg", "--urdf", str(tmp_path / "arm.urdf"), "--base-link", "base", "--flange-link", "tool"]
    first = ["import", "lerobot", str(cell), str(one), "--robot", "left", "--motors", "left_*", "--camera", "eye"]
    assert main([*first, *base, "--film", "left_wrist"]) == 0
    capsys.readouterr()
    second = ["import", "lerobot", str(cell), str(other), "--robot", "right", "--motors", "right_*"]
    assert main([*second, "--every-s", "0", *base]) == 0
    assert "2 of 60 frames" in capsys.readouterr().out
    samples = read_recording(cell).samples
    assert [sorted(sample.robots) for sample in samples] == [["left", "right"]] * 2
    for side, row, rest in (("left", 0, 8), ("right", 1, 40)):
        frames = np.array([30 * sample.stamp_s for sample in samples])
        found = np.degrees([sample.robots[side].joints_rad for sample in samples])
        np.testing.assert_allclose(found, np.maximum(frames - rest, 0)[:, None] + DEGREES[row, :6], atol=1e-6)


def test_films_go_with_a_camera(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Whose film it is has to be said."""
    words = ["import", "lerobot", str(tmp_path / "c"), str(tmp_path), "--robot", "left", "--unit", "deg"]
    assert main([*words, "--film", "wrist"]) == 2
    assert "--film and --on belong to --camera" in capsys.readouterr().err


def test_a_film_gives_a_new_cell_its_size(tmp_path: Path, arm: SerialChain, capsys: pytest.CaptureFixture[str]) -> None:
    """The size that `basecal new` writes is an example until a camera is recorded; who carries it is stated."""
    (tmp_path / "arm.urdf").write_text(chain_urdf(arm, "base", "tool"))
    data, cell = two_arms(tmp_path / "d", arm), tmp_path / "c"
    assert main(["new", str(cell), "--names", "left", "right", "--squares", "5x7", "--square", "30mm"]) == 0
    words = ["import", "lerobot", str(cell), str(data), "--robot", "left", "--unit", "deg", "--motors", "left_*"]
    words += ["--urdf", str(tmp_path / "arm.urdf"), "--base-link", "base", "--flange-link", "tool"]
    words += ["--camera", "camera", "--film", "left_wrist"]
    assert main([*words, "--on", "right"]) == 3
    assert "camera 'camera' is on 'left' in cell.yaml, not on 'right'" in capsys.readouterr().err
    assert main(words) == 0
    assert read_cell(cell).cameras["camera"].size_px == (64, 48)
