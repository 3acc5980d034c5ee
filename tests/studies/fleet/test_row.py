"""Tests of the row of a cell in a fleet, valid or faulty."""

from __future__ import annotations

import json

import numpy as np
import pytest

from basecal.cell import Calibration, Cell, Finding, Recording, Residuals, Robot, Sample, Validation
from basecal.cell.files import calibration_from_dict, input_hashes, write_cell, write_recording
from basecal.geometry import SE3, PoseEstimate
from basecal.simulation import Scenario, simulate
from basecal.studies.fleet import row as module
from basecal.studies.fleet.row import COLUMNS, calibrate_row, killed_row


@pytest.fixture
def folder(tmp_path):
    made = simulate(Scenario(samples=10, target="pose"), 1)
    write_cell(made.cell, tmp_path / "a")
    write_recording(made.recording, tmp_path / "a")
    return tmp_path


@pytest.mark.journey
def test_row_of_good_cell_has_its_results(folder) -> None:
    """The row has the numbers of the calibration, which is returned as well, with hashes of its inputs."""
    found = json.loads(calibrate_row(str(folder), "a"))
    row, made = found["row"], calibration_from_dict(found["calibration"])
    assert tuple(row) == COLUMNS
    assert (row["cell"], row["verdict"], row["samples"]) == ("a", made.verdict, 10)
    base = made["eye_base_from_hand_base"]
    assert row["transform"] == "eye_base_from_hand_base"
    assert [row[name] for name in ("x_m", "y_m", "z_m")] == pytest.approx(list(base.mean.translation), abs=1e-12)
    assert row["sigma_mm"] == pytest.approx(1e3 * base.covariance[:3, :3].trace() ** 0.5)
    assert dict(made.inputs) == input_hashes(folder / "a")
    assert found["fault"] == ""


@pytest.mark.journey
def test_page_is_made_from_calibration(folder) -> None:
    """The page gets the cell, the recording and the calibration with its hashes, titled by the cell's path."""

    def make_page(cell, recording, made, title):
        """Text of the arguments."""
        return f"{title} {cell.reference} {len(recording.samples)} {sorted(made.inputs)}"

    found = json.loads(calibrate_row(str(folder), "a", make_page))
    assert found["page"] == "a eye 10 ['cell.yaml', 'recording/samples.jsonl']"
    assert json.loads(calibrate_row(str(folder), "a"))["page"] == ""


def test_unreadable_cell_has_a_row(folder) -> None:
    """The row has the message of `calibrate`, on one line."""
    (folder / "a" / "cell.yaml").write_text("gossip: 1\n")
    found = json.loads(calibrate_row(str(folder), "a"))
    assert found["row"]["verdict"] == "unreadable"
    assert found["row"]["said"].startswith("cell.yaml")
    assert "\n" not in found["row"]["said"]
    assert found["calibration"] is None
    assert json.loads(calibrate_row(str(folder), "none"))["row"]["verdict"] == "unreadable"


def test_row_of_refused_cell_has_its_finding(folder) -> None:
    """The row has the code of the finding, and its message."""
    samples = folder / "a" / "recording" / "samples.jsonl"
    samples.write_text(samples.read_text().splitlines()[0] + "\n")
    row = json.loads(calibrate_row(str(folder), "a"))["row"]
    assert (row["verdict"], row["transform"], row["sigma_mm"]) == ("refused", None, None)
    assert "too-few-samples" in row["findings"].split()
    assert row["said"]


@pytest.mark.parametrize(
    ("error", "message"), [(TypeError("odd"), "TypeError: odd"), (MemoryError(), "not enough memory")]
)
def test_internal_fault_has_a_row(folder, monkeypatch, error, message) -> None:
    """A fault of basecal has its traceback, an error of memory has none."""

    def fails(cell, recording):
        """Raise the error."""
        raise error

    monkeypatch.setattr(module, "calibrate", fails)
    found = json.loads(calibrate_row(str(folder), "a"))
    assert found["row"]["verdict"] == "failed"
    assert message in found["row"]["said"]
    assert ("Traceback" in found["fault"]) == isinstance(error, TypeError)


def test_killed_cell_has_a_row() -> None:
    """The row states the reason."""
    row = json.loads(killed_row("a", "is there enough memory?"))["row"]
    assert (row["cell"], row["verdict"], row["said"]) == ("a", "failed", "is there enough memory?")


def test_row_has_the_numbers_of_its_calibration() -> None:
    """Each finding is listed once, the worst first, without infos. Lengths are in mm, angles in degrees."""
    cell = Cell("eye", {"eye": Robot("eye"), "hand": Robot("hand")})
    pose = SE3.from_rpy((0, 0, np.pi / 2), (1.0, 2.0, 3.0))
    covariance = np.diag(np.array([1e-3, 2e-3, 2e-3, *np.radians([1, 2, 2])]) ** 2)
    codes = (("overfit", "warning"), ("dropped-sample", "info"), ("not-converged", "error"), ("overfit", "warning"))
    calibration = Calibration(
        "doubtful",
        {"eye_base_from_hand_base": PoseEstimate(pose, covariance)},
        findings=tuple(Finding(code, severity, (), f"It is {code}.") for code, severity in codes),
        residuals=Residuals(0.25),
        validation=Validation("k-fold", 5, 0.3, 2e-3, np.radians(0.5)),
    )
    row = module._row("a", cell, Recording((Sample(0), Sample(4))), calibration)
    assert (row.cell, row.verdict, row.samples) == ("a", "doubtful", 2)
    assert row.findings == "not-converged overfit"
    assert row.said == "It is not-converged."
    assert row.transform == "eye_base_from_hand_base"
    assert (row.x_m, row.y_m, row.z_m) == (1.0, 2.0, 3.0)
    assert (row.qx, row.qy, row.qz, row.qw) == pytest.approx((0, 0, 0.5**0.5, 0.5**0.5))
    assert (row.sigma_mm, row.sigma_deg) == pytest.approx((3.0, 3.0))
    assert (row.rms_px, row.held_out_mm, row.held_out_deg) == pytest.approx((0.25, 2.0, 0.5))
    bare = module._row("a", cell, Recording(()), Calibration("good", validation=Validation("k-fold", 5, 0.3)))
    assert (bare.findings, bare.said, bare.samples, bare.transform) == ("", "", 0, None)
    assert (bare.held_out_mm, bare.held_out_deg, bare.rms_px) == (None, None, None)
