"""Tests of symbolic links in a cell: no file outside is written, and none is read through the cell's own files."""

from __future__ import annotations

from pathlib import Path
from shutil import copytree

import pytest
from tests.shared.stages import without_stages

from basecal.accuracy.stages.concluding import find_error_at_task
from basecal.accuracy.stages.solving import screen_conventions
from basecal.cell.files import append_sample, latest_run, read_recording
from basecal.cli import main
from basecal.errors import InputError

answers_alone = without_stages(screen_conventions, find_error_at_task)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Cell with a run."""
    folder = tmp_path_factory.mktemp("made") / "cell"
    assert main(["simulate", str(folder), "--samples", "4", "--target", "pose"]) == 0
    assert main(["calibrate", str(folder)]) in (0, 1)
    return folder


@pytest.fixture
def cell(made: Path, tmp_path: Path) -> Path:
    return copytree(made, tmp_path / "cell")


@pytest.fixture
def outside(tmp_path: Path) -> Path:
    """Folder with a file that must not change."""
    folder = tmp_path / "outside"
    folder.mkdir()
    (folder / "victim").write_text("mine")
    yield folder
    assert [path.name for path in folder.iterdir()] == ["victim"]
    assert (folder / "victim").read_text() == "mine"


@pytest.mark.parametrize("name", [".report.html.part", "report.html", "report.txt"])
def test_links_in_a_run_are_not_followed(cell: Path, outside: Path, name: str) -> None:
    """A file of a run, or of an earlier output beside it, that links outside the cell is not written."""
    link = latest_run(cell) / name
    link.unlink(missing_ok=True)
    link.symlink_to(outside / "victim")
    assert main(["report", str(cell)]) in (0, 1)


@pytest.mark.journey
def test_linked_runs_folder_is_refused(cell: Path, outside: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`calibrate` writes no run through a link."""
    (cell / "runs").rename(cell / "old")
    (cell / "runs").symlink_to(outside)
    assert main(["calibrate", str(cell)]) == 3
    assert "runs is a link, and files are written only inside the cell" in capsys.readouterr().err


def test_linked_run_gets_no_page(cell: Path, outside: Path, tmp_path: Path) -> None:
    """`report` writes no page through a link."""
    run = latest_run(cell)
    elsewhere = run.rename(tmp_path / "elsewhere")
    run.symlink_to(elsewhere)
    (elsewhere / "report.html").unlink()
    assert main(["report", str(cell)]) == 3
    assert not (elsewhere / "report.html").exists()


@pytest.mark.parametrize("name", ["cell.yaml", "recording/samples.jsonl", "recording"])
def test_cell_and_recording_are_read_from_the_cell(
    cell: Path, tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Links of these files to the outside are refused."""
    elsewhere = (cell / name).rename(tmp_path / "elsewhere")
    (cell / name).symlink_to(elsewhere)
    capsys.readouterr()
    assert main(["calibrate", str(cell)]) == 3
    assert "is a link that leads out of the cell" in capsys.readouterr().err


def test_samples_are_not_appended_through_a_link(cell: Path, outside: Path) -> None:
    """No file outside is appended to."""
    sample = read_recording(cell).samples[0]
    journal = cell / "recording" / "samples.jsonl"
    journal.unlink()
    journal.symlink_to(outside / "victim")
    with pytest.raises(InputError, match="cannot be written"):
        append_sample(cell, sample)


def test_new_does_not_write_through_a_link(tmp_path: Path, outside: Path) -> None:
    """A dangling link cell.yaml counts as an existing file."""
    folder = tmp_path / "fresh"
    folder.mkdir()
    (folder / "cell.yaml").symlink_to(outside / "new")
    assert main(["new", str(folder)]) == 3
    assert main(["simulate", str(folder)]) == 3
