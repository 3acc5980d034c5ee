"""Tests of `basecal study`."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.cell.files import read_cell, read_recording, write_cell, write_recording
from basecal.cli import main
from basecal.cli.study import cell_page
from basecal.simulation import Scenario, simulate
from scene_points import made_scene
from scene_tracks import write_tracks
from study_example import SMALL

TEXT = (
    f"schema: basecal/study/1\ntitle: Small\ntrials: 4\ncells: 2\nhold: {{{SMALL}}}\naxes: {{pixel_px: [0.1, 0.2]}}\n"
)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    path.write_text(TEXT)
    return path


@pytest.mark.journey
def test_json_is_the_summary(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One object has the paths of table and page; the folder has the same summary."""
    folder = file.parent / "out"
    assert main(["study", str(file), "--workers", "1", "-o", str(folder), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [point["at"] for point in told["points"]] == [{"pixel_px": 0.1}, {"pixel_px": 0.2}]
    assert Path(told["table"]).is_file()
    assert "Small" in Path(told["page"]).read_text()
    kept = json.loads((folder / "summary.json").read_text())
    assert {key: told[key] for key in kept} == kept
    assert (folder / "study.yaml").read_text() == TEXT


@pytest.mark.journey
def test_output_folder_is_named_after_the_file(
    file: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without -o the results are in such a folder of the working directory."""
    monkeypatch.chdir(file.parent)
    assert main(["study", file.name, "--workers", "1"]) == 0
    said = capsys.readouterr().out
    assert "4/4" in said
    assert "page: small/report.html" in said
    assert (file.parent / "small" / "report.html").is_file()


def test_invalid_files_exit_with_code_3(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One line has path, line and field; no file is written."""
    file.write_text(TEXT.replace("trials", "trails"))
    assert main(["study", str(file), "-o", str(file.parent / "out")]) == 3
    said = capsys.readouterr()
    assert said.out == ""
    assert f"{file}:1: trials: missing; add it; line 3: trails: unknown field (did you mean 'trials'?)" in said.err
    assert said.err.count("\n") == 1
    assert not (file.parent / "out").exists()


def test_folder_with_other_files_is_unchanged(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The folder of the file itself is not used for the results."""
    assert main(["study", str(file), "--workers", "1", "-o", str(file.parent)]) == 3
    assert "choose another folder" in capsys.readouterr().err
    assert [path.name for path in file.parent.iterdir()] == ["small.yaml"]


@pytest.mark.journey
def test_folder_of_cells_is_calibrated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each cell is a row, including invalid ones; without -o the results are in a folder named after theirs."""
    made = simulate(Scenario(samples=10, target="pose"), 1)
    for name in ("a", "b"):
        write_cell(made.cell, tmp_path / "line" / name)
        write_recording(made.recording, tmp_path / "line" / name)
    (tmp_path / "line" / "b" / "cell.yaml").write_text("gossip: 1\n")
    monkeypatch.chdir(tmp_path)
    assert main(["study", "--cells", "line", "--workers", "1", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["cells"] == 2
    assert told["verdicts"]["unreadable"] == 1
    assert Path(told["table"]).parent == Path("line_calibrated")
    shown = Path(told["page"]).read_text()
    assert "unreadable" in shown
    (linked,) = re.findall(r'href="(cells/[^"]*)"', shown)
    assert "<h1" in (Path(told["page"]).parent / linked).read_text()
    assert main(["study", "--cells", "line", "--workers", "1"]) == 0
    said = capsys.readouterr().out
    assert "b: unreadable" in said
    assert "page: line_calibrated/report.html" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "give the file of a study, or --cells"),
        (["x.yaml", "--cells", "x"], "one of them"),
        (["x.yaml", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1"], "give only one of them"),
    ],
)
def test_contradictory_options_are_wrong_usage(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Each is reported in one line."""
    assert main(["study", *words]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.journey
def test_page_of_a_scene_equals_that_of_calibrate(tmp_path: Path) -> None:
    """It has the points of the scene as a target, which the expected error and the images need."""
    write_tracks(tmp_path, made_scene(2, count=12, points=150))
    cell = read_cell(tmp_path)
    recording = read_recording(tmp_path, cell)
    calibration = calibrate(cell, recording)
    assert calibration.scene is not None
    assert "expected error, 95 %" in cell_page(cell, recording, calibration, "scene")
