"""`board-shape`: a board that is not as flat as stated."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.findings.board_shape import board_shape
from basecal.cell.targets.chessboard import chessboard_target

BOARD = chessboard_target((9, 7), 0.04)


def made(evidence, bow, sigma=0.1):
    """Evidence about a board of 32 cm with such a bow, its coefficients known to `sigma`."""
    of = evidence({"noise": SimpleNamespace(bows={"board": (np.array(bow), sigma**2 * np.eye(3))})})
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
    assert "up to 0.36 mm off their plane" in found.message
    assert found.about == ("board",)


def test_less_than_a_tenth_of_a_millimetre_is_not_worth_a_word(evidence):
    """A bow that is known to a hundredth of its prior, and small."""
    assert board_shape(made(evidence, (0.1, 0.0, 0.05), sigma=0.003)) == []
