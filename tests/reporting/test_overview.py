"""Tests of the overview at the top of the page."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

from basecal.cell import Calibration, CellTarget, Unknown
from basecal.reporting.overview import _options, answer_words, cell_words, provenance
from basecal.simulation import Scenario, simulate

CELL = simulate(Scenario(samples=2, joints=True), 0).cell


def test_overview_describes_calibration_and_cell():
    """The overview describes the calibration and the cell in words.

    It has the date, the requested transform, the robots, the camera and the target, with lengths in mm.
    """
    answer, parts = dict(answer_words(CELL, datetime(2026, 11, 2, 4, 5, tzinfo=UTC))), list(cell_words(CELL))
    assert answer["Calibrated"] == "Monday 2 November 2026, 04:05 UTC"
    assert answer["Requested"] == "where hand_base is, seen from eye_base"
    robots = [words for name, words in parts if name == "Robot"]
    assert robots == ["eye, the reference, joints recorded, eye.urdf", "hand, joints recorded, hand.urdf"]
    cell = dict(parts)
    assert cell["Camera"] == "wrist, on the flange of eye, 1280 x 720 px, pinhole, lens as stated"
    assert cell["Target"].startswith("board, on the flange of hand, charuco, 7 x 7 squares, square 30 mm, marker 22 mm")


def test_target_on_world_is_observed_as_poses():
    """A target of unknown shape on the world is described as beside the robots and observed as poses."""
    cell = replace(CELL, targets={"tag": CellTarget("tag", "world", Unknown())})
    assert dict(cell_words(cell))["Target"] == "tag, beside the robots, seen as poses"
    assert "Calibrated" not in dict(answer_words(cell, None))


def test_count_of_one_is_singular():
    """An LED has "1 point", in the singular."""
    light = simulate(Scenario(samples=2, target="led"), 0).cell
    assert dict(cell_words(light))["Target"].endswith(", led, 1 point")


def test_provenance_lists_files_versions_and_settings():
    """The tables list input files, versions, statuses and settings. Tables without entries are omitted."""
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


def test_provenance_distinguishes_stated_and_estimated_noise():
    """The unstated noise of a robot is "estimated" if the calibration has its sigmas."""
    cell = simulate(Scenario(samples=2, robot_noise=(1e-4, 1e-4), state_robot_noise=False), 0).cell
    estimated = Calibration("good", noise={"robots": {"eye": {}}})
    known = provenance(cell, estimated)["What was known"]
    assert known["noise of eye"] == "estimated"
    assert known["noise of hand"] == "none, assumed exact"
    refused = provenance(cell, Calibration("refused", settings={"robot_noise": "estimated"}))
    assert refused["What was known"]["noise of eye"] == "not estimated"


def test_target_options_are_described_in_words():
    """Lengths of target options are in mm, and pairs of integers are columns and rows.

    Other lists are given by their number of entries.
    """
    options = {
        "squares": [5, 7],
        "square_m": 0.0305,
        "legacy_pattern": True,
        "asymmetric": False,
        "dictionary": "DICT_4X4_50",
        "border": 2,
        "tags": [1, 2, 3],
        "points": [[0.0, 0.0]],
        "sizes_m": [0.1, 0.2],
        "marks": [],
    }
    assert list(_options(options)) == [
        "5 x 7 squares",
        "square 30.5 mm",
        "legacy pattern",
        "DICT_4X4_50",
        "border 2",
        "3 tags",
        "1 point",
        "2 sizes",
        "0 marks",
    ]


def test_pose_cell_has_no_robot_file_or_image_size():
    """A robot with recorded poses has no file, and a camera without images has no image size or lens."""
    cell = simulate(Scenario(samples=2, target="pose"), 0).cell
    words = list(cell_words(cell))
    assert words[:2] == [("Robot", "eye, the reference, poses recorded"), ("Robot", "hand, poses recorded")]
    assert ("Camera", "wrist, on the flange of eye") in words
    assert ("Target", "board, on the flange of hand, seen as poses") in words
