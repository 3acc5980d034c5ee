"""What an answer was made from."""

from __future__ import annotations

from basecal.cell import Calibration
from basecal.reporting.provenance import provenance
from basecal.simulation import Scenario, simulate


def test_tables():
    """Files, versions, statuses and settings as they were; nothing where nothing is known."""
    cell = simulate(Scenario(samples=2, target_mount="prior", robot_noise=(1e-4, 1e-4)), 0).cell
    calibration = Calibration(
        "good",
        settings={"start": "closed", "task_point": None},
        inputs={"cell.yaml": "sha256:0"},
        versions={"numpy": "2.0"},
        condition=1234.0,
    )
    tables = provenance(cell, calibration)
    assert tables["Files"] == {"cell.yaml": "sha256:0"}
    assert tables["Programs"] == {"numpy": "2.0"}
    assert tables["Settings"] == {"start": "closed", "task_point": "none", "condition number": "1.23e+03"}
    known = tables["What was known"]
    assert known["hand_flange_from_board"] == "prior"
    assert known["intrinsics of wrist"] == "fixed"
    assert known["noise of eye"] == "stated"
    assert "Programs" not in provenance(cell, Calibration("good"))


def test_noise_is_stated_estimated_or_none():
    """Robots that state none are estimated where the calibration has their sigmas."""
    cell = simulate(Scenario(samples=2, robot_noise=(1e-4, 1e-4), state_robot_noise=False), 0).cell
    estimated = Calibration("good", noise={"robots": {"eye": {}}})
    known = provenance(cell, estimated)["What was known"]
    assert known["noise of eye"] == "estimated"
    assert known["noise of hand"] == "none, assumed exact"
    refused = provenance(cell, Calibration("refused", settings={"robot_noise": "estimated"}))
    assert refused["What was known"]["noise of eye"] == "not estimated"
