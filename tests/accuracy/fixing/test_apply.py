"""Tests of `apply_cure`: fixes in the files of a cell."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from basecal.accuracy.fixing.apply import _state_words, apply_cure, describe_change
from basecal.accuracy.fixing.change import Change
from basecal.accuracy.fixing.cures import Cure
from basecal.accuracy.fixing.places import free_lens_entry
from basecal.cell import Finding, Recording, RobotState
from basecal.cell.files import read_cell, read_recording, write_cell, write_recording
from basecal.errors import InputError
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

FINDING = Finding("x", "warning", (), "Something is wrong.")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = simulate(Scenario(samples=4), 2)
    write_cell(made.cell, tmp_path)
    write_recording(made.recording, tmp_path)
    return tmp_path


def test_files_change_and_originals_are_kept(folder: Path) -> None:
    """Samples and lines are written, the originals are kept byte for byte, and the change is documented beside them."""
    cell = read_cell(folder)
    recording = read_recording(folder, cell)
    before = {name: (folder / name).read_bytes() for name in ("cell.yaml", "recording/samples.jsonl")}
    change = Change(recording.samples[1:], free_lens_entry(cell, "wrist"))
    assert list(describe_change(recording, change)) == [
        "cell.yaml: cameras.wrist.intrinsics.status: free",
        "cell.yaml: cameras.wrist.intrinsics.exact: false",
        "samples left out: 0",
    ]
    kept = apply_cure(folder, Cure(FINDING, "Leave out sample 0.", change))
    after = read_cell(folder)
    assert after.cameras["wrist"].intrinsics.status == "free"
    assert [sample.sample for sample in read_recording(folder, after).samples] == [1, 2, 3]
    assert {(kept / "cell.yaml").read_bytes(), (kept / "samples.jsonl").read_bytes()} == set(before.values())
    assert "Leave out sample 0." in (kept / "change.json").read_text()


def test_changed_states_are_described(folder: Path) -> None:
    """Each robot with a changed state is described before and after; an added robot has no state before."""
    samples = read_recording(folder, read_cell(folder)).samples
    recording = Recording((samples[0], replace(samples[1], robots={"hand": samples[1].robots["hand"]})))
    moved = RobotState(SE3.identity())
    changed = (samples[0], replace(samples[1], robots={**samples[1].robots, "hand": moved}))
    assert list(describe_change(recording, Change(changed))) == [
        "samples changed: 1 of 2",
        f"sample 1, hand: {samples[1].robots['hand'].base_from_flange!r} becomes {SE3.identity()!r}",
    ]


def test_invalid_cell_changes_no_file(folder: Path) -> None:
    """A value that a cell cannot have is refused before any file is written."""
    before = (folder / "cell.yaml").read_bytes()
    cure = Cure(FINDING, "Break it.", Change(cell={("targets", "board", "square_m"): -1.0}))
    with pytest.raises(InputError):
        apply_cure(folder, cure)
    assert (folder / "cell.yaml").read_bytes() == before
    assert not (folder / "originals").exists()


def test_fix_without_change_is_refused(folder: Path) -> None:
    """A fix that the files already contain is refused, and no originals are kept."""
    cell = read_cell(folder)
    samples = read_recording(folder, cell).samples
    square = cell.targets["board"].target.options["square_m"]
    cure = Cure(FINDING, "Write it.", Change(samples, {("targets", "board", "square_m"): square}))
    with pytest.raises(InputError, match="already contains this, nothing is changed: Write it"):
        apply_cure(folder, cure)
    assert not (folder / "originals").exists()


def test_states_are_described_by_joints_or_pose() -> None:
    """States are described by joints or pose to five digits."""
    assert _state_words(RobotState(joints_rad=np.array([0.1234567, -2.0]))) == "joints 0.12346, -2"
    assert _state_words(RobotState(SE3.identity())) == repr(SE3.identity())
