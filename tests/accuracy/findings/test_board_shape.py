"""`board-shape`: a board that is not as flat as stated, points in space that are off."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.findings.board_shape import board_shape
from basecal.cell.targets.chessboard import chessboard_target
from basecal.cell.targets.points import points_target

BOARD = chessboard_target((9, 7), 0.04)
BODY = points_target(0.06 * np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 1) for z in (-1, 1)]))


def made(evidence, bow, sigma=0.1):
    """Evidence about a board of 32 cm with such a bow, its coefficients known to `sigma`."""
    of = evidence({"noise": SimpleNamespace(shapes={"board": (np.array(bow), sigma**2 * np.eye(3))})})
    of.cell.targets = {"board": SimpleNamespace(target=BOARD)}
    return of


@pytest.mark.parametrize(
    ("bow", "severity"),
    [((0.3, 0.0, 0.3), None), ((1.0, 0.0, 0.5), "info"), ((0.0, 2.9, 0.0), "info"), ((0.0, 3.1, 0.0), "warning")],
)
def test_a_bow_beyond_chance_is_told(evidence, bow, severity):
    """Nothing within four sigmas; an info of what prints are, a warning beyond."""
    told = board_shape(made(evidence, bow))
    assert [f.severity for f in told] == ([] if severity is None else [severity])


def test_the_height_is_in_the_message(evidence):
    """A twist of one sigma lifts corners by 0.3 % of the half size times their u v: 0.36 mm here."""
    (found,) = board_shape(made(evidence, (0.0, 1.0, 0.0)))
    assert "up to 0.36 mm from their plane" in found.message
    assert found.about == ("board",)


def test_less_than_a_tenth_of_a_millimetre_is_not_worth_a_word(evidence):
    """A bow that is known to a hundredth of its prior, and small."""
    assert board_shape(made(evidence, (0.1, 0.0, 0.05), sigma=0.003)) == []


@pytest.mark.parametrize(("times", "severity"), [(0.5, None), (1.0, "info"), (3.1, "warning")])
def test_points_in_space_that_are_off_are_told(evidence, times, severity):
    """Coordinates off by so many sigmas, known to 0.6 of one: chance, what bodies are made to, and more than that."""
    shape = times * np.where(np.arange(36) % 2, 1.0, -1.0) * np.sqrt(30 / 36)
    of = evidence({"noise": SimpleNamespace(shapes={"board": (shape, 0.36 * np.eye(36))})})
    of.cell.targets = {"board": SimpleNamespace(target=BODY)}
    found = board_shape(of)
    assert [f.severity for f in found] == ([] if severity is None else [severity])
    assert all("Points of board are up to" in f.message for f in found)


def test_a_target_without_points_has_no_shape(evidence):
    """Of one that is seen only as poses nothing is told, of the next it is, in whole words."""
    of = made(evidence, (0.0, 1.0, 0.0))
    of.solution.noise.shapes = {"posed": of.solution.noise.shapes["board"], **of.solution.noise.shapes}
    of.cell.targets["posed"] = SimpleNamespace(target=None)
    (found,) = board_shape(of)
    assert found.what == "board is not flat: its points are up to 0.36 mm from their plane."
    assert found.why == "The answer contains the shape."
    (bent,) = board_shape(made(evidence, (0.0, 3.1, 0.0)))
    assert bent.why == "That is more than the usual bow of printed boards."
    assert bent.do == ("Check the stated points, the lens model and the target's size.",)
