"""What stands first on the page."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

from basecal.cell import CellTarget, Unknown
from basecal.reporting.overview import answer_words, cell_words
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
