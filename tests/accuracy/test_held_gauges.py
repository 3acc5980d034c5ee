"""What held parameters leave uncertain: the base of the drawing is within its sigma, and what meets is not wider."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.compare import compare
from basecal.accuracy.held_gauges import held_gauges
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate

ARMS = Scenario(samples=15, joints=True)
BASE = "eye_base_from_hand_base"
OFFSETS = replace(ARMS, joint_offset_rad=4e-3, joint_offsets="free")
LINKS = replace(ARMS, samples=30, link_error=(2e-4, 1e-3), link_parameters="free")


def squared_distance(made, covariance):
    solution = solve(made.cell, made.recording)
    off = (solution.state.transforms[BASE].inverse() @ made.truth[BASE]).log()
    return float(off @ np.linalg.solve(solution.joint_transform_covariance([BASE]) + covariance, off))


@pytest.mark.parametrize("scenario", [OFFSETS, LINKS])
def test_the_base_of_the_drawing_is_within_its_sigma(scenario):
    """A gauge at zero is as far off as the parameters that it holds: each arm's first joint, or links."""
    made = simulate(scenario, 0)
    gauges = held_gauges(solve(made.cell, made.recording), [BASE])
    assert [gauge.robot for gauge in gauges] == ["eye", "hand"]
    assert squared_distance(made, 0.0) > 30
    assert squared_distance(made, sum(gauge.covariance for gauge in gauges)) < 17  # 99 % of six freedoms


def test_held_offsets_are_of_the_size_of_those_found():
    """Both first joints turn the base about their axes."""
    made = simulate(OFFSETS, 1)
    gauges = held_gauges(solve(made.cell, made.recording), [BASE])
    for gauge in gauges:
        assert gauge.parameters == ("joint_offsets",)
        assert 2e-3 < np.sqrt(np.trace(gauge.covariance[3:, 3:])) < 8e-3
        assert np.linalg.matrix_rank(gauge.covariance, tol=1e-12) == 1


@pytest.mark.parametrize("scenario", [ARMS, replace(OFFSETS, joint_offsets="prior")])
def test_nothing_is_held_without_a_free_gauge(scenario):
    """A prior's covariance contains it."""
    made = simulate(replace(scenario, samples=6), 0)
    assert held_gauges(solve(made.cell, made.recording), [BASE]) == ()


def test_a_calibration_holds_gauges_apart():
    """They are part of its covariance, and neither of what meets nor of what differs between two runs."""
    made = simulate(OFFSETS, 2)
    found = calibrate(made.cell, made.recording, Settings(robot_noise="stated"))
    at = slice(6 * found.order.index(BASE), 6 * found.order.index(BASE) + 6)
    np.testing.assert_array_equal(found.joint_covariance[at, at], found[BASE].covariance)
    held = sum(found.gauge_covariances(BASE).values())
    assert np.linalg.eigvalsh(found[BASE].covariance - held).min() > 0
    assert found.meeting.sigma_m < 0.2 * found[BASE].sigma_norms[0]
    assert compare(found, found).transforms[BASE].sigmas == pytest.approx(0.0)
