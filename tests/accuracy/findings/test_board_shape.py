"""Tests of the finding `board-shape`: boards that are not flat as stated, and points in space that are off."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.findings.board_shape import board_shape
from basecal.cell.targets.chessboard import chessboard_target
from basecal.cell.targets.points import points_target

BOARD = chessboard_target((9, 7), 0.04)
BODY = points_target(0.06 * np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 1) for z in (-1, 1)]))


def make_evidence(evidence, bow, sigma=0.1):
    """Evidence about a board of 32 cm with this bow, whose coefficients have the given sigma."""
    of = evidence({"noise": SimpleNamespace(shapes={"board": (np.array(bow), sigma**2 * np.eye(3))})})
    of.cell.targets = {"board": SimpleNamespace(target=BOARD)}
    return of


@pytest.mark.parametrize(
    ("bow", "severity"),
    [((0.3, 0.0, 0.3), None), ((1.0, 0.0, 0.5), "info"), ((0.0, 2.9, 0.0), "info"), ((0.0, 3.1, 0.0), "warning")],
)
def test_bow_beyond_chance_is_reported(evidence, bow, severity):
    """A bow beyond chance is an info up to the size of usual prints, and a warning above three sigmas."""
    found = board_shape(make_evidence(evidence, bow))
    assert [f.severity for f in found] == ([] if severity is None else [severity])


def test_bow_height_is_in_message(evidence):
    """The message contains the height of the bow.

    A twist of one sigma lifts corners by 0.3 % of the half size times their u v: 0.36 mm here.
    """
    (found,) = board_shape(make_evidence(evidence, (0.0, 1.0, 0.0)))
    assert "up to 0.36 mm from their plane" in found.message
    assert found.about == ("board",)


def test_bow_below_tenth_of_millimetre_is_ignored(evidence):
    """A bow below 0.1 mm is ignored, though it is known to a hundredth of its prior."""
    assert board_shape(make_evidence(evidence, (0.1, 0.0, 0.05), sigma=0.003)) == []


@pytest.mark.parametrize(("times", "severity"), [(0.5, None), (1.0, "info"), (3.1, "warning")])
def test_offsets_of_points_in_space_are_reported(evidence, times, severity):
    """Points in space that are off by several sigmas are reported.

    Known to 0.6 sigma, they are chance, usual tolerance (info), or more (warning).
    """
    shape = times * np.where(np.arange(36) % 2, 1.0, -1.0) * np.sqrt(30 / 36)
    of = evidence({"noise": SimpleNamespace(shapes={"board": (shape, 0.36 * np.eye(36))})})
    of.cell.targets = {"board": SimpleNamespace(target=BODY)}
    found = board_shape(of)
    assert [f.severity for f in found] == ([] if severity is None else [severity])
    assert all("Points of board are up to" in f.message for f in found)


def test_target_without_points_has_no_shape(evidence):
    """A target that is seen only as poses has no shape finding; the next target gets its full message."""
    of = make_evidence(evidence, (0.0, 1.0, 0.0))
    of.solution.noise.shapes = {"posed": of.solution.noise.shapes["board"], **of.solution.noise.shapes}
    of.cell.targets["posed"] = SimpleNamespace(target=None)
    (found,) = board_shape(of)
    assert found.what == "board is not flat: its points are up to 0.36 mm from their plane."
    assert found.why == "The answer contains the shape."
    (bent,) = board_shape(make_evidence(evidence, (0.0, 3.1, 0.0)))
    assert bent.why == "That is more than the usual bow of printed boards."
    assert bent.do == ("Check the stated points, the lens model and the target's size.",)
