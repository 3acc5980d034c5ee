"""The command line: help, usage, exit codes, new, simulate and import."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import read_cell, read_recording, read_truth
from basecal.cli import main
from basecal.geometry import SE3
from basecal.registry import IMPORTS

VERBS = ["new", "simulate", "demo", "calibrate", "report", "export", "merge", "study"]
VERBS += [f"import {kind}" for kind in IMPORTS]


def drawn(count: int, seed: int) -> SE3:
    return SE3.exp(np.random.default_rng(seed).normal(size=(count, 6)))


def stack(path: Path, poses: SE3) -> str:
    np.savetxt(path, poses.matrix.reshape(-1, 4))
    return str(path)


@pytest.fixture
def files(tmp_path: Path) -> dict[str, str]:
    """Text files of four poses for each stream."""
    names = ("eye-base-from-flange", "hand-base-from-flange", "camera-from-target")
    return {name: stack(tmp_path / f"{name}.txt", drawn(4, seed)) for seed, name in enumerate(names)}


def options(files: dict[str, str]) -> list[str]:
    return [word for name, path in files.items() for word in (f"--{name}", path)]


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help_with_an_example(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    """`--help` of a verb tells it with an example that names it, and ends well."""
    assert main([*verb.split(), "--help"]) == 0
    told = capsys.readouterr().out
    assert "For example:" in told
    assert f"    basecal {verb}" in told


def test_help_lists_the_verbs(capsys: pytest.CaptureFixture[str]) -> None:
    """`--help` names every verb, and `--version` says the package's."""
    assert main(["--help"]) == 0
    told = capsys.readouterr().out
    assert all(verb.split()[0] in told for verb in VERBS)
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip()[0].isdigit()


@pytest.mark.parametrize(
    "words",
    [
        ["calibrat"],
        ["new"],
        ["new", "x", "--robots", "two"],
        ["new", "x", "--robots", "0"],
        ["new", "x", "--target", "unicorn"],
        ["new", "x", "--bogus"],
        ["simulate", "x", "--pixel-px", "-1"],
        ["simulate", "x", "--pixel-px", "nan"],
        ["simulate", "x", "--seed", "-1"],
        ["study"],
        ["study", "x.yaml", "--workers", "0"],
        ["study", "paper", "--seed", "-1"],
        ["study", "paper", "--draws", "1"],
        ["import", "poses", "x", "--camera-from-target", "b.txt"],
        ["import", "poses", "x", "--camera-from-target", "b.txt", "--length-unit", "inch"],
        ["import", "poses", "x", "--camera-from-target", "b.txt", "--length-unit", "m", "--invert", "everything"],
    ],
)
def test_wrong_usage_is_two(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """Wrong usage is one line on stderr and exit code 2."""
    assert main(words) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("basecal: error: ")
    assert said.err.count("\n") == 1


def test_process_exit_code(tmp_path: Path) -> None:
    """The process ends with the code, without a traceback."""
    ended = subprocess.run(
        [sys.executable, "-m", "basecal", "calibrate", str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 3
    assert ended.stdout == ""
    assert ended.stderr.startswith("basecal: error: ")
    assert ended.stderr.count("\n") == 1


@pytest.mark.parametrize("robots", [1, 2, 3, 4])
@pytest.mark.parametrize("target", ["charuco", "chessboard", "circles", "apriltag", "points", "led", "pose"])
def test_new_cells_can_be_read(tmp_path: Path, robots: int, target: str) -> None:
    """A new cell is readable at once, for every kind of target and number of robots, with all transforms free."""
    assert main(["new", str(tmp_path / "c"), "--robots", str(robots), "--target", target]) == 0
    cell = read_cell(tmp_path / "c")
    assert len(cell.robots) == robots
    assert {unknown.status for unknown in cell.transforms.values()} == {"free"}
    assert len(cell.transforms) == 3 * max(robots - 1, 0) + (2 if robots == 1 else 0)
    assert read_recording(tmp_path / "c").samples == ()


def test_new_explains_every_transform(tmp_path: Path) -> None:
    """The comments of a new cell name each transform as the library does."""
    main(["new", str(tmp_path), "--robots", "3"])
    text = (tmp_path / "cell.yaml").read_text()
    assert all(f"# {name}" in text for name in read_cell(tmp_path).transforms)


def test_nothing_is_overwritten(tmp_path: Path, files: dict[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    """`new`, `simulate`, `demo` and `import` refuse a folder that holds a cell or a recording, and leave it alone."""
    folder = str(tmp_path / "c")
    assert main(["simulate", folder, "--samples", "3"]) == 0
    before = {path: path.read_bytes() for path in Path(folder).rglob("*") if path.is_file()}
    capsys.readouterr()
    for words in (["new", folder], ["simulate", folder], ["demo", folder]):
        assert main(words) == 3
        assert "not overwritten" in capsys.readouterr().err
    assert main(["import", "poses", folder, *options(files), "--length-unit", "m"]) == 3
    assert "not overwritten" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in Path(folder).rglob("*") if path.is_file()} == before


@pytest.mark.parametrize("robots", [1, 2, 3])
@pytest.mark.parametrize("target", ["charuco", "led", "pose", "points3d"])
def test_simulated_cells_can_be_read(
    tmp_path: Path, robots: int, target: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A simulated cell has the samples asked for, and a truth for each of its transforms."""
    words = ["simulate", str(tmp_path), "--robots", str(robots), "--target", target, "--samples", "6", "--json"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["samples"] == len(read_recording(tmp_path).samples) > 0
    assert read_truth(tmp_path).keys() == read_cell(tmp_path).transforms.keys()


def test_simulated_noise_is_stated(tmp_path: Path) -> None:
    """Noise asked for on the command line is in SI units in the cell."""
    main(["simulate", str(tmp_path), "--robot-noise-mm", "0.3", "--robot-noise-mrad", "0.5", "--pixel-px", "0.4"])
    cell = read_cell(tmp_path)
    np.testing.assert_allclose(cell.robots["eye"].noise, [3e-4] * 3 + [5e-4] * 3)
    assert cell.pixel_px == 0.4


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
    assert "no camera 'cam'? --camera is one of: camera" in capsys.readouterr().err
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


def test_import_pixels(tmp_path: Path, files: dict[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    """Pixels join the robots' poses of their sample; without a cell to say what they are of, they are refused."""
    (tmp_path / "p.csv").write_text("sample,id,u,v\n0,0,10,20\n0,1,30,40\n3,2,50,60\n")
    del files["camera-from-target"]
    words = ["import", "pixels", str(tmp_path / "c"), str(tmp_path / "p.csv"), *options(files), "--length-unit", "m"]
    assert main(words) == 3
    assert "basecal new" in capsys.readouterr().err
    main(["new", str(tmp_path / "c")])
    assert main([*words, "--sigma-px", "0.3"]) == 0
    samples = read_recording(tmp_path / "c").samples
    assert [len(sample.observations) for sample in samples] == [1, 0, 0, 1]
    np.testing.assert_array_equal(samples[0].observations[0].pixels, [[10, 20], [30, 40]])
    np.testing.assert_array_equal(samples[0].observations[0].sigma_px, [0.3, 0.3])
    np.testing.assert_array_equal(samples[3].observations[0].ids, [2])
