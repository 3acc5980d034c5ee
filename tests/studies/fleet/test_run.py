"""Tests of running a fleet: each cell is calibrated once, until it changes."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from basecal.cell.files import read_calibration, write_cell, write_recording
from basecal.errors import InputError
from basecal.simulation import Scenario, simulate
from basecal.studies.fleet import run as module
from basecal.studies.fleet.run import find_cells, fingerprint, make_fleet, run_fleet
from basecal.studies.fleet.summary import fleet_rows
from basecal.studies.jobs import WorkerPool


def make(folder: Path, names: list[str]) -> Path:
    for seed, name in enumerate(names):
        made = simulate(Scenario(samples=8, target="pose"), seed)
        write_cell(made.cell, folder / name)
        write_recording(made.recording, folder / name)
    return folder


def without_time(fleet) -> list[dict]:
    return [{name: value for name, value in row.items() if name != "time_s"} for row in fleet_rows(fleet)]


def test_unchanged_cells_are_not_repeated(tmp_path, monkeypatch) -> None:
    """An interrupted run resumes with the next cell, and only a changed cell is calibrated again."""
    folder, done = make(tmp_path / "cells", ["a", "b", "line/c"]), []
    fleet = make_fleet(folder, tmp_path / "out")

    def once(of, cell, make_page):
        """Make an empty row, and interrupt the second time."""
        if len(done) == 1:
            raise KeyboardInterrupt
        done.append(cell)
        return module.killed_row(cell, "not tried")

    monkeypatch.setattr(module, "calibrate_row", once)
    with pytest.raises(KeyboardInterrupt):
        run_fleet(fleet, WorkerPool(1))
    monkeypatch.setattr(
        module, "calibrate_row", lambda of, cell, make_page: done.append(cell) or module.killed_row(cell, "not tried")
    )
    steps: list[tuple[int, int]] = []
    run_fleet(fleet, WorkerPool(1), lambda *at: steps.append(at))
    assert done == ["a", "b", "line/c"]
    assert steps == [(1, 3), (2, 3), (3, 3)]
    samples = folder / "b" / "recording" / "samples.jsonl"
    samples.write_text(samples.read_text() + "\n")
    run_fleet(make_fleet(folder, tmp_path / "out"), WorkerPool(1))
    assert done[3:] == ["b"]


@pytest.mark.journey
def test_calibrations_are_stored_with_rows(tmp_path) -> None:
    """No file is written among the cells, and damaged rows are computed again."""
    folder = make(tmp_path / "cells", ["a"])
    before = sorted(path for path in folder.rglob("*"))
    fleet = make_fleet(folder, tmp_path / "out")
    run_fleet(fleet, WorkerPool(1))
    assert sorted(path for path in folder.rglob("*")) == before
    row = fleet_rows(fleet)[0]
    kept = read_calibration(tmp_path / "out" / "cells" / "a")
    assert kept.verdict == row["verdict"]
    assert row["x_m"] == pytest.approx(kept["eye_base_from_hand_base"].mean.translation[0], abs=1e-12)
    for damaged in ("", "[]", json.dumps({"fingerprint": fleet.fingerprint("a")}), "[" * 100_000):
        (tmp_path / "out" / "cells" / "a" / "row.json").write_text(damaged)
        assert fleet.row("a") is None


@pytest.mark.slow
def test_rows_are_independent_of_number_of_processes(tmp_path) -> None:
    """One and two processes give the same rows to the last digit, except for times."""
    folder = make(tmp_path / "cells", ["a", "b", "c", "d"])
    (folder / "c" / "cell.yaml").write_text("gossip: 1\n")
    for workers in (1, 2):
        run_fleet(make_fleet(folder, tmp_path / str(workers)), WorkerPool(workers))
    assert without_time(make_fleet(folder, tmp_path / "1")) == without_time(make_fleet(folder, tmp_path / "2"))


def test_invalid_output_folder_is_refused(tmp_path) -> None:
    """The output folder must not be among the cells or contain other files."""
    folder = make(tmp_path / "cells", ["a"])
    with pytest.raises(InputError, match="is among the cells"):
        make_fleet(folder, folder / "out")
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="holds other files"):
        make_fleet(folder, tmp_path / "notes")
    assert [path.name for path in (tmp_path / "notes").iterdir()] == ["mine.txt"]


def cell(folder, text="x"):
    (folder / "recording").mkdir(parents=True)
    (folder / "cell.yaml").write_text(text)
    (folder / "recording" / "samples.jsonl").write_text("{}\n")
    return folder


def test_cells_are_found_at_any_depth(tmp_path) -> None:
    """Cells are found in order, without cells inside of others, hidden folders and links.

    A cell without its cell.yaml is included.
    """
    cell(tmp_path / "b" / "two")
    cell(tmp_path / "a")
    cell(tmp_path / "a" / "inner")
    cell(tmp_path / ".hidden" / "c")
    (tmp_path / "bare" / "recording").mkdir(parents=True)
    (tmp_path / "notes").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "a")
    assert find_cells(tmp_path) == ("a", "b/two", "bare")


def test_folder_without_cells_is_refused(tmp_path) -> None:
    """A folder without cells, and a path that is no folder, are refused."""
    with pytest.raises(InputError, match="holds no cell"):
        find_cells(tmp_path)
    with pytest.raises(InputError, match="is not a folder"):
        find_cells(tmp_path / "none")


def test_fingerprint_detects_changes(tmp_path) -> None:
    """The fingerprint depends on all files except generated ones, and on what else determines the answer."""
    folder = cell(tmp_path / "a")
    first = fingerprint(folder, "1")
    for made in ("runs", "derived"):
        (folder / made).mkdir()
        (folder / made / "x").write_text("x")
    assert fingerprint(folder, "1") == first
    assert fingerprint(folder, "2") != first
    samples = folder / "recording" / "samples.jsonl"
    os.utime(samples, ns=(0, samples.stat().st_mtime_ns + 1))
    assert fingerprint(folder, "1") != first
    changed = fingerprint(folder, "1")
    (folder / "recording" / "images").mkdir()
    (folder / "recording" / "images" / "derived").write_text("a file of such a name further down counts")
    assert fingerprint(folder, "1") != changed
