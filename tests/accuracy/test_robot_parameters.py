"""Tests of `robot_parameters`: estimated kinematics, and gauges that are not estimates."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from basecal.accuracy import robot_parameters as module
from basecal.accuracy.robot_parameters import calibrated_kinematics, robot_parameters
from basecal.cell import Calibration, RobotParameters
from basecal.effects.joint_offsets import Stated
from basecal.effects.registry import ROBOT_PARAMETERS
from basecal.errors import InputError
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate

ARMS = Scenario(samples=30, joints=True)
DEGREE = np.pi / 180
ENDS = [False, True, True, True, True, False]


def joint_offsets(solution):
    return robot_parameters(solution)["joint_offsets"]


def test_first_and_last_joint_rest_on_prior():
    """First and last joints have the prior's sigma and are not seen; the base's sigma contains the first's."""
    made = simulate(replace(ARMS, joint_offset_rad=0.2 * DEGREE, joint_offsets="prior"), 0)
    solution = solve(made.cell, made.recording)
    for offsets in joint_offsets(solution).values():
        assert offsets.seen.tolist() == ENDS
        np.testing.assert_allclose(offsets.sigma[[0, 5]], 0.2 * DEGREE, rtol=1e-6)
        assert np.all(offsets.sigma[1:5] < 0.1 * DEGREE)
    turn = np.linalg.norm(solution.transforms["eye_base_from_hand_base"].sigma_r)
    as_stated = replace(made.cell, robots={n: replace(r, parameters={}) for n, r in made.cell.robots.items()})
    alone = np.linalg.norm(solve(as_stated, made.recording).transforms["eye_base_from_hand_base"].sigma_r)
    assert turn > np.sqrt(2) * 0.19 * DEGREE > 3 * alone


@pytest.mark.journey
def test_known_mount_shows_last_joint():
    """With the camera mount fixed the eye's last offset is seen; with base and target mount fixed also its first."""
    fixed = replace(ARMS, joint_offset_rad=0.2 * DEGREE, joint_offsets="prior", camera_mount="fixed")
    made = simulate(fixed, 0)
    assert joint_offsets(solve(made.cell, made.recording))["eye"].seen.tolist() == [False, True, True, True, True, True]
    made = simulate(replace(fixed, base="fixed", target_mount="fixed"), 0)
    assert all(of.seen.all() for of in joint_offsets(solve(made.cell, made.recording)).values())


@pytest.mark.journey
def test_unobservable_free_offsets_are_nan():
    """Free first and last offsets are NaN with free ends; all offsets of a still arm are."""
    free = replace(ARMS, joint_offset_rad=0.2 * DEGREE, joint_offsets="free")
    made = simulate(free, 0)
    found = joint_offsets(solve(made.cell, made.recording))
    for offsets in found.values():
        assert np.isfinite(offsets.values).tolist() == ENDS == np.isfinite(offsets.sigma).tolist()
    still = simulate(replace(free, arms="eye_still", camera_mount="fixed"), 0)
    found = joint_offsets(solve(still.cell, still.recording))
    assert not np.any(np.isfinite(found["eye"].values))
    assert np.isfinite(found["hand"].values).tolist() == ENDS


def test_compliances_shown_by_gravity_are_found():
    """Compliances of joints 2 and 3 are found within four sigmas; the upright first axis has none to find."""
    made = simulate(replace(ARMS, compliance=1e-4, deflection="prior"), 0)
    solution = solve(made.cell, made.recording)
    for robot, found in robot_parameters(solution)["deflection"].items():
        assert found.seen[1:3].all()
        assert not found.seen[0]
        off = np.abs(found.values - made.robots[robot].kind_values("deflection"))
        assert np.all(off[found.seen] < 4 * found.sigma[found.seen])


@pytest.mark.slow
@pytest.mark.parametrize("target", ["charuco", "led"])
def test_errors_match_covariance(target):
    """Errors of the base and of the hand's seen offsets match their covariance over 60 cells.

    Stops err by 0.1 mm and 0.1 mrad. The chi-square bands contain all but one in a million of such sums.
    """
    scenario = replace(ARMS, target=target, robot_noise=(1e-4, 1e-4))
    squares, freedoms = np.zeros(2), np.zeros(2)
    for seed in range(60):
        made = simulate(replace(scenario, joint_offset_rad=0.2 * DEGREE, joint_offsets="prior"), seed)
        solution = solve(made.cell, made.recording)
        base, found = solution.transforms["eye_base_from_hand_base"], joint_offsets(solution)["hand"]
        xi = (base.mean.inverse() @ made.truth["eye_base_from_hand_base"]).log()
        off = (found.values - made.robots["hand"].kind_values("joint_offsets"))[found.seen]
        spread = found.covariance[np.ix_(found.seen, found.seen)]
        squares += xi @ np.linalg.solve(base.covariance, xi), off @ np.linalg.solve(spread, off)
        freedoms += 6, len(off)
    assert np.all(chi2.ppf(5e-7, freedoms) < squares)
    assert np.all(squares < chi2.isf(5e-7, freedoms))


def test_link_parameter_errors_match_sigmas():
    """The errors of all 84 link parameters of two arms with priors match their sigmas.

    Each error over its sigma has unit variance; they are correlated, so that the band of their mean square is wide: the
    prior's own directions alone, two thirds of them, have a standard error of 0.2.
    """
    made = simulate(replace(ARMS, link_error=(5e-4, 1e-3), link_parameters="prior"), 0)
    found = robot_parameters(solve(made.cell, made.recording))["link_parameters"]
    errors = [(found[r].values - made.robots[r].kind_values("link_parameters")) / found[r].sigma for r in found]
    assert 0.4 < np.mean(np.square(errors)) < 1.8


@pytest.mark.journey
def test_offset_is_seen_from_half_prior_variance():
    """An offset is seen if the data hold as much information as its prior.

    The variance is then half of the prior's: a prior a tenth tighter or wider decides.
    """
    made = simulate(replace(ARMS, samples=12, joint_offset_rad=1e-6, joint_offsets="prior"), 0)

    def offsets_with(sigma):
        prior = {"joint_offsets": Stated(status="prior", sigma_rad=float(sigma))}
        robots = {n: replace(r, parameters=prior) for n, r in made.cell.robots.items()}
        return joint_offsets(solve(replace(made.cell, robots=robots), made.recording))["hand"]

    # By bisection: the prior sigma at which data and prior have equal information on the third joint.
    low, high = 1e-6, 1e-2
    for _ in range(12):
        middle = np.sqrt(low * high)
        low, high = (low, middle) if offsets_with(middle).sigma[2] ** 2 < middle**2 / 2 else (middle, high)
    assert not offsets_with(0.9 * high).seen[2]
    assert offsets_with(1.1 * high).seen[2]


def test_calibrated_kinematics_add_known_parameters():
    """Calibrated kinematics are the stated ones plus known parameters.

    Unknown values count as zero, and robots without parameters are omitted.
    """
    cell = simulate(replace(ARMS, samples=3), 0).cell
    chain = cell.robots["hand"].chain
    names, nothing = chain.joint_names, np.full(6, np.nan)
    rad = np.array([np.nan, 0.1, 0.2, 0.3, 0.4, np.nan])
    tangents = 1e-3 * np.arange(42.0).reshape(7, 6)
    offsets = Calibration(
        "good", robot_parameters={"joint_offsets": {"hand": RobotParameters(names, rad, nothing, np.isfinite(rad))}}
    )
    found = calibrated_kinematics(cell, offsets)
    assert found.keys() == {"hand"}
    np.testing.assert_array_equal(found["hand"].kind_values("joint_offsets"), np.nan_to_num(rad))
    np.testing.assert_array_equal(found["hand"].kind_values("link_parameters"), np.zeros((7, 6)))
    assert "deflection" not in found["hand"].values
    assert found["hand"].chain is chain
    bent = RobotParameters(names, rad, nothing, np.isfinite(rad))
    links = RobotParameters((), tangents, np.ones((7, 6)), np.ones((7, 6), dtype=bool))
    both = Calibration("good", robot_parameters={"link_parameters": {"eye": links}, "deflection": {"hand": bent}})
    found = calibrated_kinematics(cell, both)
    np.testing.assert_array_equal(found["eye"].kind_values("link_parameters"), tangents)
    np.testing.assert_array_equal(found["eye"].kind_values("deflection"), np.zeros(6))
    np.testing.assert_array_equal(found["hand"].kind_values("deflection"), np.nan_to_num(rad))
    bare = replace(cell, robots={**cell.robots, "hand": replace(cell.robots["hand"], chain=None)})
    with pytest.raises(InputError, match="'hand', which has no urdf"):
        calibrated_kinematics(bare, offsets)


NAMES = ("a", "b", "c")
OFFSETS = np.array([0.1, 0.2, 0.3])


def known_of(kind, basis, prior, variance, values=OFFSETS):
    """A solution of an arm of three joints with these columns, and its model; two other columns come first."""
    model = SimpleNamespace(
        robot="hand",
        columns={kind: (Columns(basis, prior))},
        chain=SimpleNamespace(n=3, joint_names=NAMES),
    )
    width = 2 + basis.shape[1]
    covariance = np.arange(width * width, dtype=float).reshape(width, width) + 50 * np.eye(width)
    solution = SimpleNamespace(
        problem=SimpleNamespace(columns={f"hand_{kind}": slice(2, width)}, models={"hand": model}, width=width),
        state=SimpleNamespace(kinematics=lambda of: SimpleNamespace(kind_values=lambda kind: values)),
        covariance=covariance,
        observability=SimpleNamespace(inverse=np.diag([9.0, 9.0, *variance]), unobservable=frozenset()),
    )
    return solution, model


class Columns(tuple):
    """Columns of a model: their basis and their prior."""

    def __new__(cls, basis, prior):
        return super().__new__(cls, (basis, prior))

    basis = property(lambda self: self[0])


THIRD_AND_FIRST = np.array([[0.0, 1.0], [0.0, 0.0], [1.0, 0.0]])


@pytest.mark.parametrize(("share", "seen"), [(0.49, True), (0.51, False)])
def test_columns_map_to_their_joints(share, seen):
    """Columns map to their joints in any order.

    A joint without a column is NaN, and a variance below half of the prior's counts as seen.
    """
    prior = np.array([0.5, 2.0])
    solution, _ = known_of("joint_offsets", THIRD_AND_FIRST, prior, [share * 0.25, 0.1])
    found = joint_offsets(solution)["hand"]
    np.testing.assert_array_equal(found.values, [0.1, np.nan, 0.3])
    assert found.joints == NAMES
    assert found.seen.tolist() == [True, False, seen]
    np.testing.assert_allclose(found.sigma, np.sqrt([15 + 50, np.nan, 10 + 50]))
    assert (found.covariance[2, 0], found.covariance[0, 2]) == (11.0, 14.0)


@pytest.mark.parametrize("share", [0.98, 1.02])
def test_free_offsets_have_largest_sigma(share):
    """Free offsets are NaN beyond a largest sigma, with their covariances."""
    largest = ROBOT_PARAMETERS["joint_offsets"].largest_sigma
    solution, _ = known_of("joint_offsets", THIRD_AND_FIRST, None, [share * largest**2, 0.5 * largest**2])
    found = joint_offsets(solution)["hand"]
    assert found.seen.tolist() == [True, False, share < 1]
    assert np.isfinite(found.values).tolist() == found.seen.tolist()
    assert np.isfinite(found.covariance[0]).tolist() == [True, False, share < 1]
    assert np.isfinite(found.covariance[:, 0]).tolist() == [True, False, share < 1]


def test_joint_in_null_space_is_nan(monkeypatch):
    """A joint in the null space is NaN, even if other columns share it.

    The null space is skipped if all is observable.
    """
    solution, _ = known_of("joint_offsets", THIRD_AND_FIRST, np.array([9.0, 9.0]), [0.1, 0.1])
    rows = np.array([[1.0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])
    monkeypatch.setattr(module, "linearise", lambda problem, state: SimpleNamespace(hessian=rows.T @ rows))
    assert np.isfinite(joint_offsets(solution)["hand"].values).tolist() == [True, False, True]
    solution.observability.unobservable = frozenset({"x"})
    found = joint_offsets(solution)["hand"]
    assert np.isfinite(found.values).tolist() == [True, False, False]
    assert found.seen.tolist() == [True, False, False]


@pytest.mark.parametrize("hidden", [False, True])
def test_partly_unobservable_links_are_omitted(monkeypatch, hidden):
    """Link parameters are omitted if any of them is unobservable; else all are given, with sigmas by all columns."""
    values = np.arange(4.0).reshape(2, 2)
    basis = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.0, 2.0]])
    solution, _ = known_of("link_parameters", basis, None, [1.0, 1.0], values)
    monkeypatch.setattr(module, "_touched_by_null_space", lambda solution: np.array([True, True, hidden, False]))
    found = robot_parameters(solution)
    if hidden:
        assert found == {}
        return
    of = found["link_parameters"]["hand"]
    covariance = solution.covariance[2:, 2:]
    np.testing.assert_array_equal(of.values, values)
    np.testing.assert_allclose(of.sigma, np.sqrt(np.diag(basis @ covariance @ basis.T)).reshape(2, 2))
    assert of.seen.all()
    assert of.seen.shape == (2, 2)
