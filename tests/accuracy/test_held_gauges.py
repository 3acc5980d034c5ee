"""Tests of held gauges: the true base is within its sigma, and the meeting error is not widened."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.compare import compare
from basecal.accuracy.held_gauges import _expected_square, _free_kinds, _Kind, _squares, held_gauges
from basecal.effects.faces.shared_errors import KINEMATICS
from basecal.effects.registry import ROBOT_PARAMETERS
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate
from basecal.simulation.arms import six_axis

ARMS = Scenario(samples=15, joints=True)
BASE = "eye_base_from_hand_base"
OFFSETS = replace(ARMS, joint_offset_rad=4e-3, joint_offsets="free")
LINKS = replace(ARMS, samples=30, link_error=(2e-4, 1e-3), link_parameters="free")


def squared_distance(made, covariance):
    solution = solve(made.cell, made.recording)
    off = (solution.state.transforms[BASE].inverse() @ made.truth[BASE]).log()
    return float(off @ np.linalg.solve(solution.joint_transform_covariance([BASE]) + covariance, off))


@pytest.mark.parametrize("scenario", [OFFSETS, LINKS])
def test_base_is_within_sigma_of_gauges(scenario):
    """With the gauges' covariance the base is within its sigma.

    A gauge at zero is off by each arm's held joints or links.
    """
    made = simulate(scenario, 0)
    gauges = held_gauges(solve(made.cell, made.recording), [BASE])
    assert [gauge.robot for gauge in gauges] == ["eye", "hand"]
    assert squared_distance(made, 0.0) > 30
    assert squared_distance(made, sum(gauge.covariance for gauge in gauges)) < 17  # 99 % of six freedoms


def test_held_offsets_have_size_of_found_ones():
    """Held offsets have the size of those found; both first joints rotate the base about their axes."""
    made = simulate(OFFSETS, 1)
    gauges = held_gauges(solve(made.cell, made.recording), [BASE])
    for gauge in gauges:
        assert gauge.parameters == ("joint_offsets",)
        assert 2e-3 < np.sqrt(np.trace(gauge.covariance[3:, 3:])) < 8e-3
        assert np.linalg.matrix_rank(gauge.covariance, tol=1e-12) == 1


@pytest.mark.parametrize("scenario", [ARMS, replace(OFFSETS, joint_offsets="prior")])
def test_cells_without_free_gauge_hold_none(scenario):
    """Without free parameters no gauge is held; the covariance of a prior already contains it."""
    made = simulate(replace(scenario, samples=6), 0)
    assert held_gauges(solve(made.cell, made.recording), [BASE]) == ()


@pytest.mark.journey
def test_calibration_separates_gauges():
    """Gauges are part of the covariance, but not of the meeting error or the difference of two runs."""
    made = simulate(OFFSETS, 2)
    found = calibrate(made.cell, made.recording, Settings(robot_noise="stated"))
    at = slice(6 * found.order.index(BASE), 6 * found.order.index(BASE) + 6)
    np.testing.assert_array_equal(found.joint_covariance[at, at], found[BASE].covariance)
    held = sum(found.gauge_covariances(BASE).values())
    assert np.linalg.eigvalsh(found[BASE].covariance - held).min() > 0
    assert found.meeting.sigma_m < 0.2 * found[BASE].sigma_norms[0]
    assert compare(found, found).transforms[BASE].sigmas == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("kind", "rotations"), [("joint_offsets", [True] * 6), ("link_parameters", [False] * 3 + [True] * 3)]
)
def test_free_parameters_are_determined_or_held(kind, rotations):
    """The directions that data determine and that a gauge holds are complete, in the parameters' units.

    A translation of a link is as large as its rotation at a lever of 0.2 m; kinds with a prior are not held.
    """
    parameter = ROBOT_PARAMETERS[kind]
    stated = parameter.stated(status="free")
    units = np.diag(parameter.columns(six_axis(), stated).basis)
    found = np.linalg.qr(np.random.default_rng(0).standard_normal((len(units), 4)))[0]
    columns = {kind: (units[:, None] * found, None), "gear_ratio": (np.eye(6), None)}
    model = SimpleNamespace(chain=six_axis(), columns=columns, stated={kind: stated})
    (of,) = _free_kinds(model)
    assert of.name == kind
    np.testing.assert_allclose(of.determined, found)
    assert of.held.shape == (len(units), len(units) - 4)
    whole = np.column_stack([of.determined, of.held])
    np.testing.assert_allclose(whole @ whole.T, np.eye(len(units)), atol=1e-12)
    levers = np.where(np.resize(rotations, len(units)), 1.0, 0.2)
    np.testing.assert_allclose(of.sigmas * of.units, levers)
    prior = SimpleNamespace(chain=six_axis(), columns={kind: (columns[kind][0], np.ones(4))}, stated={kind: stated})
    assert list(_free_kinds(prior)) == []


def test_second_moments_follow_directions():
    """Second moments of independent parameters are transformed to the given directions."""
    sigmas, directions = np.array([1.0, 2.0, 3.0]), np.array([[1.0, 1.0], [0.0, 1.0], [2.0, 0.0]])
    np.testing.assert_allclose(_squares(sigmas, directions), directions.T @ np.diag(sigmas**2) @ directions)


@pytest.mark.parametrize("found", [None, 0.0, 3e-3, 0.05])
@pytest.mark.parametrize("sigma", [0.0, 5e-3])
def test_expected_size_is_posterior_mean(found, sigma):
    """The expected size is the mean by the prior alone, or by its evidence with an estimate.

    The parameter's unit is ten times as large.
    """
    middle, factor = KINEMATICS.turn
    at = np.linspace(-3.25, 3.25, 4001)
    squares, weight = (middle * factor**at) ** 2, np.exp(-0.5 * at**2)
    free = {}
    if found is not None:
        spread = 4 * squares + sigma**2
        weight = weight * np.exp(-0.5 * found**2 / spread) / np.sqrt(spread)
        free = {"arm": [_Kind("kind", np.array([10.0]), np.eye(1), np.zeros((1, 0)), np.array([2.0]))]}
    kinematics = SimpleNamespace(kind_values=lambda name: np.array([10.0 * (found or 0.0)]))
    solution = SimpleNamespace(
        problem=SimpleNamespace(columns={"arm_kind": slice(1, 2)}, models={"arm": "model"}),
        state=SimpleNamespace(kinematics=lambda model: kinematics),
        covariance=np.diag([9.0, sigma**2]),
    )
    expected = np.sum(weight * squares) / np.sum(weight)
    assert _expected_square(solution, free) == pytest.approx(expected, rel=0.05)
