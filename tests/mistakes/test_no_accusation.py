"""Tests that correct cells have no findings of mistakes."""

from __future__ import annotations

from pathlib import Path

import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.input_screening.repeated_views import repeated_views
from basecal.accuracy.input_screening.units import impossible_units
from basecal.cell.files import read_cell, read_recording
from basecal.simulation import simulate
from shared.kinds import KINDS, kind_scenario

EXAMPLES = Path(__file__).parents[2] / "examples"
MIX_UPS = {
    "angle-unit", "length-unit", "board-size", "quaternion-order", "euler-order", "matrix-transposed", "mirrored",
    "robot-pose-inverted", "target-pose-inverted", "transform-inverted", "robots-swapped", "pixels-swapped",
    "pairing-shifted", "board-symmetry", "intrinsics", "repeated-view", "few-images",
}  # fmt: skip
FIRST = 900  # seed, of cells that nothing was tuned by
SEEDS = 8  # of each of 25 kinds: 200 cells


@pytest.mark.parametrize("kind", list(KINDS))
def test_screening_of_correct_cells_has_no_findings(kind: str) -> None:
    """Two cells of each kind: no finding of a wrong unit or of a duplicate view."""
    for seed in (FIRST, FIRST + 1):
        made = simulate(kind_scenario(kind, seed), seed)
        assert impossible_units(made.cell, made.recording) == []
        assert repeated_views(made.cell, made.recording) == []


@pytest.mark.parametrize("name", ["ur5e_dual", "ur5e_images", "rct_charuco"])
def test_examples_have_no_findings_of_mistakes(name: str) -> None:
    """The recordings of real arms have no such findings."""
    cell = read_cell(EXAMPLES / name)
    recording = read_recording(EXAMPLES / name, cell)
    assert impossible_units(cell, recording) == []
    assert repeated_views(cell, recording) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(FIRST, FIRST + SEEDS))
@pytest.mark.parametrize("kind", list(KINDS))
def test_calibration_of_correct_cells_finds_no_mix_up(kind: str, seed: int) -> None:
    """200 correct cells, each calibrated completely: 25 kinds with eight seeds each."""
    made = simulate(kind_scenario(kind, seed), seed)
    found = calibrate(made.cell, made.recording)
    assert [f.code for f in found.findings if f.code in MIX_UPS and f.severity != "info"] == []
