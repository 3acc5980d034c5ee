"""Tests of `export`."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.shared.stages import without_stages

from basecal.accuracy.stages.concluding import find_error_at_task
from basecal.accuracy.stages.solving import screen_conventions
from basecal.cell import Calibration
from basecal.cell.files import latest_run, read_calibration, read_cell, write_calibration, write_cell
from basecal.cli import main
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.exchange.exporters.registry import EXPORTERS
from basecal.kinematics import read_chain
from basecal.simulation import Scenario, simulate

answers_alone = without_stages(screen_conventions, find_error_at_task)


@pytest.fixture
def off(tmp_path: Path) -> Path:
    """Cell with joint offsets."""
    folder = tmp_path / "off"
    assert main(["simulate", str(folder), "--joints", "--joint-offset-deg", "0.2"]) == 0
    return folder


@pytest.mark.journey
def test_corrected_urdf_agrees_with_the_calibration(off: Path, tmp_path: Path) -> None:
    """At recorded joints its flange equals that of the cell's chain with the offsets of calibration.json."""
    cell = (off / "cell.yaml").read_text()
    freed = cell.replace(
        "flange_link: tool0}", "flange_link: tool0, joint_offsets: {status: prior, sigma_rad: 0.0035}}"
    )
    (off / "cell.yaml").write_text(freed)
    assert main(["calibrate", str(off)]) == 0
    written = tmp_path / "new" / "hand.urdf"
    assert main(["export", str(off), "--to", "urdf", "--robot", "hand", "-o", str(written)]) == 0
    run = latest_run(off)
    assert run is not None
    offsets = read_calibration(run).parameters_of_robot("hand")["joint_offsets"].values
    assert np.abs(offsets).max() > 1e-4
    joints = np.random.default_rng(0).uniform(-2, 2, (5, 6))
    chain = read_cell(off).robots["hand"].chain
    assert chain is not None
    corrected = read_chain(written, "base_link", "tool0").forward(joints)
    np.testing.assert_allclose(corrected.matrix, chain.forward(joints + offsets).matrix, atol=1e-13)


@pytest.mark.journey
def test_missing_input_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No run, an unknown robot, and a run without offsets cause one line each, exit code 3 and no file."""
    cell = str(tmp_path / "cell")
    assert main(["simulate", cell, "--joints", "--samples", "12"]) == 0
    words = ["export", cell, "-o", str(tmp_path / "x.urdf"), "--to", "urdf", "--robot"]
    assert main([*words, "hand"]) != 0
    assert "has no run yet" in capsys.readouterr().err
    main(["calibrate", cell, "--robot-noise", "stated"])
    capsys.readouterr()
    assert main([*words, "hand"]) != 0
    assert "no joint offsets of 'hand'" in capsys.readouterr().err
    assert main([*words, "foot"]) != 0
    assert "foot" in capsys.readouterr().err
    assert not (tmp_path / "x.urdf").exists()


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Calibrated cell."""
    folder = tmp_path_factory.mktemp("solved") / "cell"
    assert main(["simulate", str(folder), "--samples", "20"]) == 0
    assert main(["calibrate", str(folder), "--robot-noise", "stated"]) == 0
    return folder


def test_only_the_pose_is_printed(solved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Stdout has the pose of calibration.json; each direction has its name, and formats ignore case."""
    run = latest_run(solved)
    assert run is not None
    mean = read_calibration(run)["eye_base_from_hand_base"].mean
    for words, pose in ((["ur"], mean), (["UR", "--transform", "hand_base_from_eye_base"], mean.inverse())):
        capsys.readouterr()
        assert main(["export", str(solved), "--to", *words]) == 0
        told = capsys.readouterr()
        assert told.err.startswith("next: ")
        assert f"run {run.name} from cell.yaml sha256:" in told.out
        numbers = [float(word) for word in told.out.splitlines()[-1].removeprefix("p[").removesuffix("]").split(", ")]
        np.testing.assert_allclose(numbers, [*pose.translation, *pose.rotvec], atol=1e-5)


def test_each_controller_has_its_own_line(solved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without a kind: p[...] for the UR and $BASE for the KUKA, each in the frame of its recorded poses."""
    cell = tmp_path / "cell"
    shutil.copytree(solved, cell)
    known = read_cell(cell)
    told = {"eye": {"format": "ur"}, "hand": {"format": "kuka", "base": "BASE_3", "tool": "TOOL_1"}}
    robots = {name: replace(robot, controller=told[name]) for name, robot in known.robots.items()}
    write_cell(replace(known, robots=robots), cell)
    run = latest_run(cell)
    assert run is not None
    mean = read_calibration(run)["eye_base_from_hand_base"].mean
    capsys.readouterr()
    assert main(["export", str(cell)]) == 0
    out = capsys.readouterr().out
    assert "# for eye, in the frame that its poses were recorded in: eye_base, its base: no other was stated" in out
    assert "; for hand, in the frame that its poses were recorded in: BASE_3, which is hand_base here" in out
    assert "hand_flange is TOOL_1" in out
    (line,) = [line for line in out.splitlines() if line.startswith("p[")]
    numbers = [float(word) for word in line[2:-1].split(", ")]
    np.testing.assert_allclose(numbers, [*mean.translation, *mean.rotvec], atol=1e-5)
    base = next(line for line in out.splitlines() if line.startswith("$BASE="))
    written = [float(word.split()[1]) for word in base[len("$BASE={") : base.index("}")].split(",")]
    np.testing.assert_allclose(written[:3], 1e3 * mean.inverse().translation, atol=1e-2)


@pytest.mark.journey
def test_any_two_frames_are_exported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In a ring of three, the pose of one base in another, neither the reference: in json with the joint covariance."""
    made = simulate(Scenario(layout="ring", robots=3, samples=30, robot_noise=(1e-4, 1e-4)), 1)
    solution = solve(made.cell, made.recording, Settings(robot_noise="stated"))
    order = tuple(solution.transforms)
    status = dict.fromkeys(order, "free")
    joint = solution.joint_transform_covariance(list(order))
    calibration = Calibration("good", solution.transforms, status, order=order, joint_covariance=joint)
    folder = tmp_path / "ring"
    folder.mkdir()
    write_cell(made.cell, folder)
    run = write_calibration(calibration, folder)
    expected = read_calibration(run).between("r2", "r3")
    capsys.readouterr()
    assert main(["export", str(folder), "--to", "json", "--transform", "r2_base_from_r3_base"]) == 0
    told = json.loads(capsys.readouterr().out)["transforms"]["r2_base_from_r3_base"]
    np.testing.assert_allclose(told["matrix"], expected.mean.matrix, atol=1e-12)
    np.testing.assert_allclose(told["covariance"], expected.covariance, atol=1e-15)
    assert main(["export", str(folder), "--to", "matrix", "--transform", "r2_base_from_r3_base"]) == 0
    assert "the pose of r3_base in r2_base, m; 1 sigma" in capsys.readouterr().out
    assert main(["export", str(folder), "--to", "matrix", "--transform", "r2_base_from_r9_base"]) == 3
    assert "no 'r9_base'" in (said := capsys.readouterr().err)
    assert "there are: r1_base, r2_base" in said


def test_run_is_chosen_by_name(solved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An older run can be chosen; for a missing run the error lists the existing ones."""
    run = latest_run(solved)
    assert run is not None
    assert main(["export", str(solved), "--to", "matrix", "--run", run.name]) == 0
    assert run.name in capsys.readouterr().out
    assert main(["export", str(solved), "--to", "matrix", "--run", "../x"]) == 3
    assert run.name in capsys.readouterr().err


def test_output_file_is_written_and_reported(solved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With `-o` the text is written to the file, and its path is printed."""
    out = tmp_path / "new" / "base.launch.py"
    assert main(["export", str(solved), "--to", "ros2", "-o", str(out)]) == 0
    assert f"written: {out}" in capsys.readouterr().out
    assert main(["export", str(solved), "--to", "ros2"]) == 0
    assert out.read_text() == capsys.readouterr().out


def test_one_urdf_of_two_robots(solved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The URDF is made from the given files, one for each robot."""
    arm = str(Path(__file__).parents[1] / "data" / "urdf" / "six_axis.urdf")
    assert main(["export", str(solved), "--to", "urdf_cell", "--urdf", arm, arm]) == 0
    assert '<joint name="eye_base_to_hand_base" type="fixed">' in capsys.readouterr().out


def test_doubtful_runs_have_a_comment_and_refused_runs_are_not_exported(
    solved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A comment and stderr report a doubtful run with code 0; no file is written for a refused one, with code 4."""
    cell = tmp_path / "cell"
    shutil.copytree(solved, cell)
    run = latest_run(cell)
    assert run is not None
    for verdict, code in (("doubtful", 0), ("refused", 4)):
        data = json.loads((run / "calibration.json").read_text())
        (run / "calibration.json").write_text(json.dumps(data | {"verdict": verdict}))
        assert main(["export", str(cell), "--to", "ur", "-o", str(tmp_path / verdict)]) == code
        assert verdict in capsys.readouterr().err
    assert "DOUBTFUL" in (tmp_path / "doubtful").read_text()
    assert not (tmp_path / "refused").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--to", "sdf"], "no 'sdf'"),
        (["--to", "ur", "--robot", "hand"], "--to ur takes --transform, not --robot"),
        (["--to", "urdf", "--transform", "x"], "--to urdf takes --robot, not --transform"),
        (["--robot", "hand"], "without --to only --transform is accepted"),
    ],
)
def test_wrong_usage_exits_with_code_2(
    words: list[str], said: str, solved: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An unknown kind, an option of another kind, and no kind are wrong usage."""
    assert main(["export", str(solved), *words]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("kind", EXPORTERS)
def test_help_names_every_kind(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The help of the verb names each kind."""
    main(["export", "--help"])
    assert f"{kind}: " in capsys.readouterr().out
