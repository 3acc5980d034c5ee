"""`board-size` of conventions, and `length-scale` of systematic errors: told once."""

from dataclasses import replace

import numpy as np
import pytest
from tests.shared.rewriting import resized

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.systematic_errors.size_findings import deduplicate_size_findings
from basecal.cell import Finding
from basecal.effects.faces.effect import FoundEffect
from basecal.simulation import Scenario, simulate

CELL = simulate(Scenario(samples=1), 0).cell
SIZE = Finding("board-size", "warning", ("board",), "board is 1.1 times as large as stated")
LENGTH = Finding("length-scale", "warning", ("hand",), "poses of hand are too long")
OTHER = Finding("poor-fit", "warning", ("hand",), "residuals are large")
OF_ROBOT = FoundEffect(
    "length_scale", "length-scale", "hand", False, False, None, "", np.array([-0.12]), np.array([[1e-4]]), np.zeros(6)
)
OF_TARGET = replace(OF_ROBOT, about="board", is_target=True, size=np.array([0.12]))


@pytest.mark.parametrize("found", [OF_TARGET, replace(OF_ROBOT, alternatives=(OF_TARGET,))])
def test_a_size_that_both_tests_find_is_told_once(found):
    """By the test that knows the arms' noise, with its sigma and what to write; other findings stay."""
    told = deduplicate_size_findings(CELL, [SIZE, OTHER, LENGTH], found)
    assert [f.code for f in told] == ["board-size", "poor-fit"]
    assert "board is 1.136 ± 0.013 times as large as stated" in told[0].message
    assert f"square_m would be {1.13636 * CELL.targets['board'].target.options['square_m']:.5g}" in told[0].message
    assert ("which the data do not determine" in told[0].message) == bool(found.alternatives)


def test_of_two_robots_the_one_whose_lengths_are_off_is_told():
    """A target's size that took up a robot's lengths is not suspected any more."""
    assert deduplicate_size_findings(CELL, [SIZE, LENGTH, OTHER], OF_ROBOT) == [LENGTH, OTHER]


@pytest.mark.parametrize(
    "found",
    [None, replace(OF_TARGET, is_certain=False), replace(OF_TARGET, code="drift")],
    ids=["none", "doubt", "drift"],
)
def test_a_size_that_nothing_else_finds_stays(found):
    """Nothing better is known of it."""
    assert deduplicate_size_findings(CELL, [SIZE, OTHER], found) == [SIZE, OTHER]


def test_a_length_without_a_suspected_size_stays():
    """There is nothing to tell once."""
    assert deduplicate_size_findings(CELL, [LENGTH], replace(OF_ROBOT, alternatives=(OF_TARGET,))) == [LENGTH]


def test_a_board_stated_too_large_is_told_as_smaller():
    """Two arms with noise, the stated board 3 % larger than the true one: it is smaller than stated."""
    made = simulate(Scenario(samples=12, robot_noise=(5e-4, 1e-3), state_robot_noise=False), 0)
    found = calibrate(resized(made.cell, {"board": 1.03}), made.recording)
    (said,) = [f for f in found.findings if f.code in ("length-scale", "board-size")]
    assert said.about == ("board",)
    assert "% smaller than stated" in said.message
