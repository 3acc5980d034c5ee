"""Tests of the output of imports."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from cyclopts import App
from tests.journeys.raw import cell
from tests.shared.rewriting import inverted, with_robots

from basecal.accuracy.input_screening.quick_look import QuickLook
from basecal.cell import Cell, PoseObservation, Recording, RobotState
from basecal.cell.files import read_cell, read_recording
from basecal.cli.importing import finish_import, import_app, import_verb, say_conventions
from basecal.errors import InputError
from basecal.exchange.importers.registry import IMPORTERS
from basecal.exchange.importing.imported import Imported, Row
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from basecal.simulation.images import render_recording

MADE = simulate(Scenario(samples=12, target="pose"), 4)


@dataclass(frozen=True)
class Size:
    """Group of options."""

    rows: int = 1


def poses(robot: str, count: int, scale: float = 1.0, is_strict: bool = True) -> Imported:
    states = [RobotState(SE3.from_rotvec([0, 0, 0.1], [0.4 * scale, 0.1 * i * scale, 0])) for i in range(count)]
    rows, cell = tuple(Row({robot: state}) for state in states), {"robots": {robot: {}}}
    return Imported(f"{robot}.csv", f"{count} poses", rows, cell, is_strict=is_strict, advice="try mm")


def test_import_reports_source_pairing_and_next_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Source, pairing, changes of the cell, and the next command are a line each."""
    assert finish_import(tmp_path, poses("left", 3)) == 0
    first = capsys.readouterr().out.splitlines()
    assert first[0] == "read left.csv: 3 poses"
    assert first[-1].startswith(f"wrote 3 samples and cell.yaml to {tmp_path}: next, its images: basecal import im")
    assert finish_import(tmp_path, poses("right", 3)) == 0
    assert capsys.readouterr().out.splitlines()[1:3] == [
        "paired with 3 samples in order",
        "written to cell.yaml: robots.right",
    ]


def test_single_new_sample_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A second view of a sample becomes another sample, beside the completed ones."""
    finish_import(tmp_path, poses("left", 3))
    views = (PoseObservation("cam", "board", SE3.identity()),)
    cell = {"cameras": {"cam": {"on": "left"}}, "targets": {"board": {"on": "world"}}}
    capsys.readouterr()
    finish_import(
        tmp_path, Imported("v.csv", "3 views", tuple(Row(observations=views, sample=k) for k in (1, 1, 2)), cell)
    )
    assert capsys.readouterr().out.splitlines()[-1].startswith(f"completed the 4 samples, 1 of them new, of {tmp_path}")


def test_implausible_input_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Implausible input is imported with a warning and advice; omitted input is reported, too."""
    read = replace(poses("left", 3, 1000.0, is_strict=False), warnings=("photos: 2 files are left out",))
    assert finish_import(tmp_path / "c", read) == 0
    told = capsys.readouterr().err
    assert "warning: left.csv: flange of left 447 m" in told
    assert "try mm" in told
    assert "warning: photos: 2 files are left out" in told


def test_preview_writes_no_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Notes are printed, and no cell is made."""
    assert finish_import(tmp_path / "c", replace(poses("left", 3), notes=("3 topics",), is_preview=True)) == 0
    assert capsys.readouterr().out == "3 topics\n"
    assert not (tmp_path / "c").exists()


def test_verb_has_the_options_of_its_importer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each parameter is an option, except the progress; words, several words and groups of options arrive unchanged."""
    given: list[object] = []

    def read(
        cell: str | Path,
        file: str | Path,
        /,
        *,
        on: tuple[str, ...] = (),
        size: Size = Size(),
        progress: Callable[[int, int], None] | None = None,
    ) -> Imported:
        """Read a file."""
        given.extend([cell, file, on, size, progress is not None])
        return poses("left", 2)

    app = App(result_action="return_value")
    app.default(import_verb(read))
    app([str(tmp_path / "c"), "a.csv", "--on", "x", "y", "--rows", "3"])
    assert given == [tmp_path / "c", Path("a.csv"), ("x", "y"), Size(3), True]
    assert "wrote 2 samples" in capsys.readouterr().out


def test_every_importer_is_a_verb() -> None:
    """No importer is missing."""
    assert set(IMPORTERS) <= {*import_app()}


def test_file_replaces_recorded_poses_on_request(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without --replace the file is refused with that advice.

    With it the new poses are recorded, and the old ones are kept.
    """
    assert finish_import(tmp_path, poses("left", 3)) == 0
    journal = tmp_path / "recording" / "samples.jsonl"
    before = journal.read_bytes()
    with pytest.raises(InputError, match="or --replace for better ones"):
        finish_import(tmp_path, poses("left", 3, 0.5))
    assert journal.read_bytes() == before
    assert finish_import(tmp_path, poses("left", 3, 0.5), replace=True) == 0
    cell = read_cell(tmp_path)
    state = read_recording(tmp_path, cell).samples[2].robots["left"]
    np.testing.assert_allclose(state.base_from_flange.translation, [0.2, 0.1, 0])
    (kept,) = (tmp_path / "originals").iterdir()
    assert (kept / "samples.jsonl").read_bytes() == before
    capsys.readouterr()


def said(
    recording: Recording, capsys: pytest.CaptureFixture[str], of: Cell = MADE.cell, folder: Path = Path()
) -> tuple[bool, str, str]:
    is_wrong = bool(say_conventions(folder, of, recording))
    streams = capsys.readouterr()
    return is_wrong, streams.out, streams.err


def test_confirmed_conventions_are_reported(capsys: pytest.CaptureFixture[str]) -> None:
    """One line has the error by which the conventions are confirmed."""
    is_wrong, out, err = said(MADE.recording, capsys)
    assert (is_wrong, err) == (False, "")
    assert out.startswith("conventions hold: each of 12 views is predicted by the others to ")
    assert out.count("\n") == 1


@pytest.mark.journey
def test_contradicted_convention_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    """The finding is a warning with the fix."""
    is_wrong, out, err = said(with_robots(MADE.recording, {"hand": inverted}), capsys)
    assert (is_wrong, out) == (True, "")
    assert "warning: robot-pose-inverted, by 12 views: The poses of hand are inverted" in err
    assert "or invert the poses. Or let `basecal fix .` do so." in err


def test_undecided_conventions_are_reported(capsys: pytest.CaptureFixture[str]) -> None:
    """Too few views do not decide on the conventions."""
    is_wrong, out, _ = said(Recording(MADE.recording.samples[:3]), capsys)
    expected = "conventions are not determined by 3 views: 5 with the robots' poses are needed\n"
    assert (is_wrong, out) == (False, expected)


@pytest.mark.parametrize(
    ("views", "ending"), [(0, ": a reason"), (1, " by 1 view: a reason"), (2, " by 2 views: a reason")]
)
def test_views_that_were_not_tested_are_not_counted(
    views: int, ending: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a test of conventions there is a reason and no number."""
    look = QuickLook(views, undetermined="a reason")
    monkeypatch.setattr("basecal.accuracy.input_screening.quick_look.quick_look", lambda *_: look)
    assert said(MADE.recording, capsys)[1] == f"conventions are not determined{ending}\n"


@pytest.mark.journey
def test_detections_are_kept_for_calibration(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Detections in imported images serve the next calibration."""
    made = cell(samples=6, seed=3)
    recording = render_recording(made, tmp_path)
    is_wrong, out, _ = said(recording, capsys, made.cell, tmp_path)
    assert not is_wrong
    assert out.startswith("conventions hold: each of 6 views")
    assert list((tmp_path / "derived").rglob("*"))
