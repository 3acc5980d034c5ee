"""Tests of `basecal import touches`: tables of two controllers give a base, without a camera."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from tests.touch_cells import MARKS, TIPS, TRUTH, flange_pose, held_poses

from basecal.cell.files import latest_run, read_calibration, read_cell, read_recording
from basecal.cli import main
from basecal.errors import DatasetError
from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.exchange.importers.touches import new_rows, touch_names
from basecal.exchange.importing.imported import NO_CELL, Row
from basecal.geometry import SE3

SIGMA_M = 1e-4


def touch_table(
    path: Path, robot: str, name: str, rng: np.random.Generator, marks=tuple(MARKS), count: int = 12
) -> str:
    """Write a file of touches of a robot, as its controller writes poses, with a column of marks."""
    how, lines, marks = CONTROLLERS[name], [], list(MARKS)
    for k in range(count):
        mark = marks[k % len(marks)]
        pose = flange_pose(rng, robot, MARKS[mark] + SIGMA_M * rng.standard_normal(3))
        (numbers,) = how.to_numbers(SE3.stack([pose]))
        lines.append(";".join([mark.upper(), *(f"{value:.10g}" for value in numbers)]))
    path.write_text("\n".join([";".join(["mark", *how.names]), *lines]) + "\n")
    return str(path)


def _is_line_of(line: str, numbers: Sequence[float]) -> bool:
    """Return whether a line such as `p[0.1, 0.2, ...]` holds these numbers, up to its digits."""
    found = [float(each) for each in re.findall(r"-?\d+\.\d+", line)]
    return len(found) == len(numbers) and bool(np.allclose(found, numbers, atol=1e-3))


@pytest.mark.journey
def test_touches_of_two_arms_give_base(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Four commands (two imports of touches, calibrate, export) give a good verdict.

    The exported base is the true one, in both controllers' notation.
    """
    rng, cell = np.random.default_rng(0), str(tmp_path / "c")
    left, right = (
        touch_table(tmp_path / n, r, how, rng) for n, r, how in (("l.csv", "eye", "kuka"), ("r.csv", "hand", "ur"))
    )
    assert main(["import", "touches", cell, "--robot", "eye", left, "--format", "kuka"]) == 0
    assert "12 touches of mark_a, mark_b, mark_c by eye_tip" in capsys.readouterr().out
    assert main(["import", "touches", cell, "--robot", "hand", right, "--format", "ur"]) == 0
    assert main(["calibrate", cell]) == 0
    capsys.readouterr()
    assert main(["export", cell]) == 0
    text = capsys.readouterr().out
    run = latest_run(cell)
    assert run is not None
    assert read_calibration(run).verdict == "good"
    found = read_calibration(run)["eye_base_from_hand_base"]
    for base, notation in ((found.mean, "kuka"), (found.mean.inverse(), "ur")):
        (numbers,) = CONTROLLERS[notation].to_numbers(SE3.stack([base]))
        assert any(_is_line_of(line, numbers) for line in text.splitlines())
    off = (found.mean.inverse() @ TRUTH).log()
    assert np.all(np.abs(off) < 4 * np.sqrt(np.diag(found.covariance)))
    assert len(read_recording(cell).samples) == 24


def test_touches_of_other_robots_are_skipped(tmp_path: Path) -> None:
    """One file may hold the touches of both robots, and more touches of a robot may follow."""
    path = tmp_path / "all.csv"
    path.write_text("robot,mark,x,y,z,qx,qy,qz,qw\neye,a,0.4,0,0.5,0,0,0,1\nhand,1,0.5,0,0.5,0,0,0,1\n")
    for robot, count in (("eye", 1), ("hand", 2), ("eye", 3)):
        words = ["import", "touches", str(tmp_path / "c"), str(path), "--robot", robot, "--format", "ros"]
        assert main([*words, "--sigma-m", "0.0002"]) == 0
        assert len(read_recording(tmp_path / "c").samples) == count
    assert {"a", "mark_1"} <= read_cell(tmp_path / "c").targets.keys()
    assert read_recording(tmp_path / "c").samples[0].observations[0].sigma_m == pytest.approx(2e-4)


def test_meeting_tips_are_paired_in_order(tmp_path: Path) -> None:
    """The poses of one robot are recorded first; touches of the other are paired with them in order."""
    rng, cell = np.random.default_rng(1), str(tmp_path / "c")
    for robot in TIPS:
        rows = [flange_pose(rng, robot, np.array([0.5, 0.1, 0.3])) for _ in range(4)]
        (tmp_path / robot).write_text(
            "\n".join(",".join(map(str, r)) for r in CONTROLLERS["ros"].to_numbers(SE3.stack(rows)))
        )
    assert (
        main(["import", "touches", cell, "--robot", "eye", str(tmp_path / "eye"), "--format", "ros", "--mark", "m"])
        == 0
    )
    words = [
        "import",
        "touches",
        cell,
        "--robot",
        "hand",
        str(tmp_path / "hand"),
        "--format",
        "ros",
        "--meets",
        "eye_tip",
    ]
    assert main(words) == 0
    assert [len(sample.observations) for sample in read_recording(cell).samples] == [2] * 4


@pytest.mark.parametrize(
    ("more", "words"), [([], "no column `mark`"), (["--mark", "m", "--meets", "t"], "exclude each other")]
)
def test_touched_mark_must_be_stated_once(tmp_path: Path, capsys: pytest.CaptureFixture[str], more, words) -> None:
    """The mark is stated by the table or by one option."""
    (tmp_path / "a.csv").write_text("x,y,z,qx,qy,qz,qw\n0.4,0,0.5,0,0,0,1\n")
    path = str(tmp_path / "a.csv")
    assert main(["import", "touches", str(tmp_path / "c"), "--robot", "eye", path, "--format", "ros", *more]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "c").exists()


def test_clamped_part_is_imported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A second table is paired with the samples of the first; the part is added to the cell with its axis."""
    cell, how, poses = str(tmp_path / "c"), CONTROLLERS["ros"], held_poses(np.random.default_rng(0), 3)
    for robot in TIPS:
        rows = how.to_numbers(SE3.stack([each[robot] for each in poses]))
        lines = [",".join(how.names), *(",".join(f"{value:.10g}" for value in row) for row in rows)]
        (tmp_path / f"{robot}.csv").write_text("\n".join(lines) + "\n")
    left, right = (str(tmp_path / f"{robot}.csv") for robot in TIPS)
    held = ["import", "touches", cell, right, "--robot", "hand", "--format", "ros", "--clamp", "rod", "--hinge"]
    assert main(held) == 2
    assert "import its poses first" in capsys.readouterr().err
    assert main(["import", "poses", cell, left, "--robot", "eye", "--format", "ros"]) == 0
    assert main(held) == 0
    assert "3 places of hand holding rod" in capsys.readouterr().out
    assert read_cell(cell).targets["rod_grip"].contact == "hinge"
    assert [sample.observations[0].kind for sample in read_recording(cell).samples] == ["clamp"] * 3


def test_touch_rows_are_selected_by_robot(tmp_path):
    """Rows of other robots are skipped; a robot without rows is an error that lists the robots."""
    (tmp_path / "a.csv").write_text("robot,point,x\nleft,A,1\nright,B,2\nleft,C,3\n")
    path = str(tmp_path / "a.csv")
    assert touch_names(path, ("x",), "left", None) == ["a", "c"]
    with pytest.raises(DatasetError, match="there are: left, right"):
        touch_names(path, ("x",), "third", None)


def test_row_without_mark_is_refused(tmp_path):
    """The error has the line, also if the last cells are missing."""
    (tmp_path / "a.csv").write_text("x,mark\n1,A\n2\n")
    with pytest.raises(DatasetError, match=r":3: mark: is empty in this row"):
        touch_names(str(tmp_path / "a.csv"), ("x",), "left", None)


def test_new_touch_rows_get_free_numbers(tmp_path: Path):
    """Numbers continue from the first free one; stated numbers are kept."""
    assert [row.sample for row in new_rows(tmp_path, NO_CELL, [Row(), Row(sample=7), Row()])] == [0, 7, 2]
