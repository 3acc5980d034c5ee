"""Tests of `basecal fix`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from shutil import copytree

import pytest
from tests.shared.real_recordings import EXAMPLES

from basecal.accuracy.fixing.change import Change
from basecal.accuracy.fixing.cures import Cure
from basecal.cell import Finding, RobotState
from basecal.cell.files import latest_run, read_calibration, write_cell, write_recording
from basecal.cli import main
from basecal.cli.fix import _chosen_cure as chosen_cure
from basecal.errors import UsageError
from basecal.simulation import Scenario, SimulatedCell, simulate


@pytest.fixture(scope="module")
def inverted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, SimulatedCell]:
    """Cell with inverted poses of the hand."""
    folder = tmp_path_factory.mktemp("inverted")
    made = simulate(Scenario(samples=12, robot_noise=(1e-4, 2e-4)), 5)
    samples = tuple(
        replace(s, robots={**s.robots, "hand": RobotState(s.robots["hand"].base_from_flange.inverse())})
        for s in made.recording.samples
    )
    write_cell(made.cell, folder)
    write_recording(replace(made.recording, samples=samples), folder)
    return folder, made


def test_equal_fixes_need_a_choice(capsys: pytest.CaptureFixture[str]) -> None:
    """Of fixes that fit equally none is applied without a choice; a single fix is."""
    finding = Finding("robot-pose-inverted", "error", ("hand",), "Inverted, or carried otherwise.")
    equal = tuple(Cure(finding, words, Change(cell={("x",): 1}), is_choice=True) for words in ("One.", "Other."))
    with pytest.raises(UsageError, match="equally: check which is true, and add --choose 1 or --choose 2"):
        chosen_cure(equal, None)
    shown = capsys.readouterr().out.splitlines()
    assert shown == ["1. One. [robot-pose-inverted]", "2. Other. [robot-pose-inverted]"]
    assert chosen_cure(equal, 2) is equal[1]
    other = Cure(replace(finding, code="length-unit"), "Another.", Change(cell={("y",): 1}))
    with pytest.raises(UsageError, match=r"add --choose 1 or --choose 3$"):
        chosen_cure((equal[0], other, equal[1]), None)
    (alone,) = (replace(cure, is_choice=False) for cure in equal[:1])
    assert chosen_cure((alone,), None) is alone


def test_board_in_millimetres_is_fixed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The refusal names the command, which searches the images that were not searched, and shows the change."""
    folder = tmp_path / "c"
    copytree(EXAMPLES / "ur5e_images", folder)
    text = (folder / "cell.yaml").read_text()
    (folder / "cell.yaml").write_text(text.replace("0.0288", "28.8").replace("0.04", "40"))
    assert main(["calibrate", str(folder)]) == 4
    assert f"Or let `basecal fix {folder}` do so." in " ".join(capsys.readouterr().out.split())
    assert main(["fix", str(folder)]) == 2
    shown = capsys.readouterr().out
    assert "Undo: the size of board is in millimetres. [board-size]" in shown
    assert "cell.yaml: targets.board.square_m: 0.04" in shown


@pytest.mark.slow  # two calibrations with all their checks
def test_diagnosed_mistake_is_fixed(inverted: tuple[Path, SimulatedCell], capsys: pytest.CaptureFixture[str]) -> None:
    """The preview shows the fix, and no file changes without confirmation.

    The answer equals that of the correct recording. It is judged by the tolerance and the place given to `calibrate`.
    """
    folder, made = inverted
    assert main(["calibrate", str(folder), "--tolerance", "1um", "--task-point", "0.8", "0.1", "0.3"]) == 4
    assert f"Or let `basecal fix {folder}` do so." in " ".join(capsys.readouterr().out.split())
    before = (folder / "recording" / "samples.jsonl").read_bytes()
    assert main(["fix", str(folder)]) == 2
    told = capsys.readouterr()
    assert "1. Undo: the poses of hand are inverted (flange_from_base). [robot-pose-inverted]" in told.out
    assert "Add --yes to apply it" in told.err
    assert (folder / "recording" / "samples.jsonl").read_bytes() == before
    assert main(["fix", str(folder), "--choose", "2", "--yes"]) == 2
    assert "there are fixes 1 to 1" in capsys.readouterr().err
    assert main(["fix", str(folder), "--yes"]) == 5
    told = capsys.readouterr()
    assert "FAIL: expected error" in told.out
    plan = f"next: basecal plan {folder} --tolerance 0.001mm --task-point 0.8 0.1 0.3 -o plan.jsonl"
    assert plan in told.err
    found = read_calibration(latest_run(folder) / "calibration.json")["eye_base_from_hand_base"]
    off = (found.mean.inverse() @ made.truth["eye_base_from_hand_base"]).log()
    assert abs(off[:3]).max() < 5e-3
    assert main(["fix", str(folder)]) == 5
    told = capsys.readouterr()
    assert "nothing to fix: FAIL: expected error" in told.out
    assert plan in told.err
