"""What stands first on the page."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from basecal.accuracy.fit_details import FitDetails
from basecal.accuracy.task.expected_error import ExpectedError
from basecal.cell import Calibration, CellTarget, Recording, Residuals, Sample, SampleResidual, Unknown
from basecal.reporting.overview import overview
from basecal.simulation import Scenario, simulate

CELL = simulate(Scenario(samples=2, joints=True), 0).cell
CALIBRATION = Calibration("good", residuals=Residuals(per_sample=(SampleResidual(0, "wrist", "board", 0.2),)))
DETAILS = FitDetails(errors=(ExpectedError("eye_base_from_hand_base", 4.384e-4, np.zeros(3)),))
RECORDING = Recording(tuple(map(Sample, range(3))))


def test_what_when_of_what_and_how_good():
    """In words, lengths in mm."""
    made = overview(CELL, RECORDING, CALIBRATION, DETAILS, datetime(2026, 11, 2, 4, 5, tzinfo=UTC))
    answer = dict(made.answer)
    assert answer["Calibrated"] == "Monday 2 November 2026, 04:05 UTC"
    assert answer["Asked for"] == "where hand_base is, seen from eye_base"
    assert answer["Expected error"] == "95 % below 0.44 mm where the arms worked"
    assert answer["Samples"] == "1 used of 3 recorded"
    robots = [words for name, words in made.cell if name == "Robot"]
    assert robots == ["eye, the reference, joints recorded, eye.urdf", "hand, joints recorded, hand.urdf"]
    cell = dict(made.cell)
    assert cell["Camera"] == "wrist, on the flange of eye, 1280 x 720 px, pinhole, lens as stated"
    assert cell["Target"].startswith("board, on the flange of hand, charuco, 7 x 7 squares, square 30 mm, marker 22 mm")


def test_a_target_seen_as_poses_beside_the_robots():
    """What has no shape and stands on the world."""
    cell = replace(CELL, targets={"tag": CellTarget("tag", "world", Unknown())})
    made = overview(cell, RECORDING, CALIBRATION, DETAILS, None)
    assert dict(made.cell)["Target"] == "tag, beside the robots, seen as poses"
    assert "Calibrated" not in dict(made.answer)
