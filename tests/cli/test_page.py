"""Tests of `report.html` of a run: when it is written, and from which files."""

from __future__ import annotations

from pathlib import Path
from shutil import copytree

import pytest
from tests.shared.stages import without_stages

from basecal.accuracy.stages.solving import screen_conventions
from basecal.cell import Calibration
from basecal.cell.files import latest_run, write_calibration
from basecal.cli import main
from basecal.cli.page import find_run
from basecal.errors import InputError

no_conventions = without_stages(screen_conventions)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Calibrated simulated cell."""
    folder = tmp_path_factory.mktemp("page") / "cell"
    main(["simulate", str(folder), "--samples", "12", "--robot-noise-mm", "0.1", "--robot-noise-mrad", "0.2"])
    main(["calibrate", str(folder)])
    return folder


@pytest.fixture
def calibrated(made: Path, tmp_path: Path) -> Path:
    """Copy of the calibrated cell, for changes."""
    return copytree(made, tmp_path / "cell")


def page_of(folder: Path) -> Path:
    run = latest_run(folder)
    assert run is not None
    return run / "report.html"


def test_stored_run_gives_the_same_page(calibrated: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`report` makes the same page from the stored files as `calibrate`, to the letter."""
    path = page_of(calibrated)
    fresh = path.read_text(encoding="utf-8")
    path.unlink()
    capsys.readouterr()
    assert main(["report", str(calibrated)]) == 0
    page, after = capsys.readouterr().err.splitlines()
    assert Path(page.removeprefix("page: ")).resolve() == path.resolve()
    assert after.startswith("next: ")
    assert path.read_text(encoding="utf-8") == fresh
    assert 'class="arrows"' in fresh
    assert str(calibrated.parent) not in fresh


@pytest.mark.journey
def test_page_belongs_to_its_run(calibrated: Path) -> None:
    """A second calibration writes its page beside its own answer, and `report` that of the latest run."""
    first = page_of(calibrated)
    kept = first.read_bytes()
    main(["calibrate", str(calibrated)])
    second = page_of(calibrated)
    assert second.parent != first.parent
    main(["report", str(calibrated)])
    assert first.read_bytes() == kept
    for path in (first, second):
        assert path.parent.name in path.read_text(encoding="utf-8")
    assert first.parent.name not in second.read_text(encoding="utf-8").replace(second.parent.name, "")


def test_changed_inputs_are_reported(calibrated: Path) -> None:
    """If a file changed after the run, the page names it and shows no residuals of single points."""
    with (calibrated / "cell.yaml").open("a") as file:
        file.write("# another comment\n")
    main(["report", str(calibrated)])
    page = page_of(calibrated).read_text(encoding="utf-8")
    assert "cell.yaml changed since this run" in page
    assert "samples.jsonl changed" not in page
    assert 'class="arrows"' not in page


def test_run_with_unreadable_recording_is_reported(calibrated: Path) -> None:
    """A stored run is reported although its recording cannot be read any more."""
    (calibrated / "recording" / "samples.jsonl").write_text("{nonsense}\n" * 2)
    assert main(["report", str(calibrated)]) == 0
    assert "samples.jsonl changed since this run" in page_of(calibrated).read_text(encoding="utf-8")


def test_json_writes_no_page(calibrated: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`report --json` prints, and writes no file."""
    page_of(calibrated).unlink()
    capsys.readouterr()
    assert main(["report", str(calibrated), "--json"]) == 0
    assert capsys.readouterr().err == ""
    assert not page_of(calibrated).exists()


def test_cell_means_its_latest_run(tmp_path: Path) -> None:
    (tmp_path / "cell.yaml").write_text("")
    with pytest.raises(InputError, match="has no run yet: basecal calibrate"):
        find_run(tmp_path)
    run = write_calibration(Calibration("refused"), tmp_path).parent
    assert find_run(tmp_path) == run
    assert find_run(run) == run
    assert find_run(run / "calibration.json") == run / "calibration.json"
