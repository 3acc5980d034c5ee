"""What stands first on the page."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

from basecal.cell import Calibration, CellTarget, Unknown
from basecal.reporting.overview import _options, answer_words, cell_words, provenance
from basecal.simulation import Scenario, simulate

CELL = simulate(Scenario(samples=2, joints=True), 0).cell


def test_what_when_of_what_and_how_good():
    """In words, lengths in mm."""
    answer, parts = dict(answer_words(CELL, datetime(2026, 11, 2, 4, 5, tzinfo=UTC))), list(cell_words(CELL))
    assert answer["Calibrated"] == "Monday 2 November 2026, 04:05 UTC"
    assert answer["Requested"] == "where hand_base is, seen from eye_base"
    robots = [words for name, words in parts if name == "Robot"]
    assert robots == ["eye, the reference, joints recorded, eye.urdf", "hand, joints recorded, hand.urdf"]
    cell = dict(parts)
    assert cell["Camera"] == "wrist, on the flange of eye, 1280 x 720 px, pinhole, lens as stated"
    assert cell["Target"].startswith("board, on the flange of hand, charuco, 7 x 7 squares, square 30 mm, marker 22 mm")


def test_a_target_seen_as_poses_beside_the_robots():
    """What has no shape and stands on the world."""
    cell = replace(CELL, targets={"tag": CellTarget("tag", "world", Unknown())})
    assert dict(cell_words(cell))["Target"] == "tag, beside the robots, seen as poses"
    assert "Calibrated" not in dict(answer_words(cell, None))


def test_one_of_a_thing_is_not_several():
    """A light has one point."""
    light = simulate(Scenario(samples=2, target="led"), 0).cell
    assert dict(cell_words(light))["Target"].endswith(", led, 1 point")


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


def test_options_are_words_and_sizes():
    """Lengths in mm, pairs of whole numbers as columns and rows, other lists by their number."""
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


def test_robots_of_poses_have_no_file_and_cameras_may_have_no_size():
    cell = simulate(Scenario(samples=2, target="pose"), 0).cell
    words = list(cell_words(cell))
    assert words[:2] == [("Robot", "eye, the reference, poses recorded"), ("Robot", "hand, poses recorded")]
    assert ("Camera", "wrist, on the flange of eye") in words
    assert ("Target", "board, on the flange of hand, seen as poses") in words
