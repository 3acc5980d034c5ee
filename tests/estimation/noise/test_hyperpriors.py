"""Tests of priors of sigmas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from basecal.effects.faces.shared_errors import KINEMATICS, SharedErrors, SharedPrior
from basecal.estimation.noise.hyperpriors import LogNormals, _part_prior, _pool_robots, hyperpriors
from basecal.estimation.noise.mixed_model import mixed_model
from basecal.estimation.noise.robot_noise import with_robot_noise, without_errors
from basecal.estimation.noise.sigma_places import SigmaPlaces
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.simulation import Scenario, simulate

ROBOTS = ("eye", "hand")
REACH_M = {"eye": 0.5, "hand": 0.8}


def _model(errors=None):
    """A mixed model of two arms with eight stops."""
    s = simulate(Scenario(samples=8, state_robot_noise=False, state_pixel_noise=False), 1)
    problem, _ = build_problem(s.cell, s.recording)
    unit = with_robot_noise(problem, dict.fromkeys(ROBOTS, np.ones(6)))
    state = without_errors(unit, State(s.truth, s.cameras, np.zeros((0, 6))))
    return mixed_model(unit, state, ROBOTS, [] if errors is None else [dict.fromkeys(ROBOTS, errors)])


def test_robots_share_a_prior_and_slopes_are_derivatives():
    """Both arms have a prior of 0.3 mrad and reach times that, and the slope equals central differences."""
    prior = hyperpriors(_model(), REACH_M)
    np.testing.assert_allclose(np.exp(prior.start[1:]), [1.5e-4, 3e-4, 2.4e-4, 3e-4], rtol=1e-9)
    logs = prior.start + np.linspace(-1, 1, 5)
    steps = 1e-5 * np.eye(5)
    slope = [(prior.value(logs + h)[0] - prior.value(logs - h)[0]) / 2e-5 for h in steps]
    np.testing.assert_allclose(prior.value(logs)[1], slope, rtol=1e-6)


def test_shared_errors_are_relative_to_stops_or_absolute():
    """The prior of shared errors is relative to the sigma of stops and the reach.

    Or it is in radians with its own lever, whatever the stops have.
    """
    model = _model(SharedErrors.repeat_coordinates(np.ones((8, 1))))
    over = hyperpriors(model, REACH_M, [SharedPrior((2.5, 2.0), "")])
    np.testing.assert_allclose(np.exp(over.start[5:]), [3.75e-4, 7.5e-4, 6e-4, 7.5e-4], rtol=1e-9)
    alone = hyperpriors(model, REACH_M, [KINEMATICS])
    np.testing.assert_allclose(np.exp(alone.start[5:]), [1.6e-4, 8e-4] * 2, rtol=1e-9)
    raised = alone.start + np.log(10) * np.repeat([1.0, 0.0], [5, 4])
    plain = hyperpriors(_model(), REACH_M)
    worse = alone.value(raised)[0] - plain.value(raised[:5])[0]
    same = alone.value(alone.start)[0] - plain.value(alone.start[:5])[0]
    np.testing.assert_allclose(worse, same)


def test_shared_errors_may_loosen_the_tie_of_stops():
    """A deviation of a tenth of the shift from reach times rotation costs as the tie states."""
    model = _model(SharedErrors.repeat_coordinates(np.ones((8, 1))))
    off = np.zeros(9)
    off[1] = 0.1
    for tie in (1.05, 2.0):
        prior = hyperpriors(model, REACH_M, [KINEMATICS._replace(tie=tie)])
        costs = prior.value(prior.start + off)[0] - prior.value(prior.start)[0]
        np.testing.assert_allclose(costs, (0.1 / np.log(tie)) ** 2)


def _cost(prior, first):
    """The cost of the first sigma relative to the expected one; 1 at a standard deviation."""
    other = np.array([np.log(first), *prior.start[1:]])
    return prior.value(other)[0] - prior.value(prior.start)[0]


def test_view_sigma_exceeds_the_scatter_of_points():
    """A ratio of 1.1 to 5 is within a standard deviation, as on real rigs.

    A fiftieth or forty times is nearly three off.
    """
    model = _model()
    (key,) = model.sigmas.views
    squares, freedoms = model.white[key]
    assert freedoms > 100
    scatter = np.sqrt(squares / freedoms)
    prior = hyperpriors(model, REACH_M)
    assert all(_cost(prior, over * scatter) < 1 for over in (1.1, 5.0))
    assert all(_cost(prior, over * scatter) > 7 for over in (0.02, 40.0))


def test_exact_points_leave_a_thousandth_of_a_pixel():
    """If points do not scatter at all, as in simulations, their view is expected off by 0.001 to 0.005 px."""
    model = _model()
    (key,) = model.sigmas.views
    exact = hyperpriors(replace(model, white={key: (0.0, 200.0)}), REACH_M)
    assert 1e-3 < np.exp(exact.start[0]) < 5e-3


def test_usual_arms_are_within_two_standard_deviations():
    """Two arms of 0.02 or 3 mrad nearly are. Those of a hundredth or a hundred times of these are not."""
    prior = hyperpriors(_model(), REACH_M)

    def cost(rad):
        """The cost of rotations of both arms, with shifts in proportion to their reach."""
        logs = prior.start + np.array([0, 1, 1, 1, 1]) * np.log(rad / 3e-4)
        return prior.value(logs)[0] - prior.value(prior.start)[0]

    assert all(cost(rad) < 2.2**2 for rad in (2e-5, 3e-3))
    assert all(cost(rad) > 4**2 for rad in (2e-7, 0.3))


def test_log_normal_priors_are_normal_in_logarithms():
    """The value is -2 log density of independent normals, and its start is their mean."""
    forms = np.array([[1.0, 0.0], [-1.0, 1.0]])
    of = LogNormals(forms, np.array([0.5, -0.2]), np.array([0.3, 2.0]))
    logs = np.array([0.9, 1.1])
    expected = -2 * norm.logpdf(forms @ logs, of.mean, of.sigma).sum()
    value, slope = of.value(logs)
    assert value == pytest.approx(expected, rel=1e-12)
    np.testing.assert_allclose(forms @ of.start, of.mean)
    np.testing.assert_allclose(of.value(of.start)[1], 0.0, atol=1e-12)
    np.testing.assert_allclose(of.curvature @ (logs - of.start), slope)


def _pooled_cost(logs, scale, factor):
    """-2 log density of robots of one cell, each within a factor of two of a shared scale within `factor`."""
    own = np.log(2.0) ** 2
    covariance = np.full((len(logs), len(logs)), np.log(factor) ** 2 - own) + own * np.eye(len(logs))
    return -2 * multivariate_normal.logpdf(logs, np.full(len(logs), np.log(scale)), covariance)


def _normal_cost(value, mean, factor):
    """-2 log density of one logarithm, or of a difference of two."""
    return -2 * norm.logpdf(value, mean, np.log(factor))


@pytest.mark.parametrize("lever", [None, 0.3])
@pytest.mark.parametrize("is_over_stop", [True, False])
def test_hyperprior_equals_the_explicit_density(lever, is_over_stop, rng):
    """The density of views by scatter, arms by reach and rotation, and shared errors is written out term by term."""
    model = _model(SharedErrors.repeat_coordinates(np.ones((8, 1))))
    common = SharedPrior((2.5, 3.0), "", is_over_stop, (lever, 1.7), tie=1.4)
    (key,) = model.sigmas.views
    model = replace(model, white={key: (9.0, 100.0)})
    prior = hyperpriors(model, {"eye": 0.5, "hand": 0.02}, [common])
    logs = prior.start + rng.standard_normal(9)
    scatter = (logs[0] - np.log(2 * 0.3)) / np.hypot(np.log(3), 1 / np.sqrt(200))
    cost = scatter**2 + np.log(2 * np.pi * (np.log(3) ** 2 + 1 / 200))
    turns, shared = logs[[2, 4]], logs[[6, 8]]
    for k, reach in enumerate((0.5, 0.1)):  # an arm is not shorter than a tenth of a metre
        cost += _normal_cost(logs[1 + 2 * k] - turns[k], np.log(reach), 1.4)
        cost += _normal_cost(logs[5 + 2 * k] - shared[k], np.log(lever or reach), 1.7)
        cost += _normal_cost(shared[k] - turns[k], np.log(2.5), 3.0) if is_over_stop else 0.0
    cost += _pooled_cost(turns, 3e-4, 4.0)
    cost += 0.0 if is_over_stop else _pooled_cost(shared, 2.5, 3.0)
    assert prior.value(logs)[0] == pytest.approx(cost, rel=1e-9)


@pytest.mark.parametrize(
    ("freedoms", "mean", "factor"), [(19.0, 0.2, 5.0), (20.0, 2.0, np.exp(np.hypot(np.log(3), 40**-0.5)))]
)
def test_twenty_freedoms_determine_the_scatter_of_points(freedoms, mean, factor):
    """With fewer freedoms, the usual noise of detectors counts, within a factor of five."""
    model = _model()
    (key,) = model.sigmas.views
    prior = hyperpriors(replace(model, white={key: (freedoms, freedoms)}), REACH_M)
    assert np.exp(prior.start[0]) == pytest.approx(mean)
    assert _cost(prior, mean * factor) == pytest.approx(1.0)
    assert _cost(prior, mean / factor) == pytest.approx(1.0)


def _with_jitter(model, *cameras):
    """The model with open jitter of these cameras."""
    of = model.sigmas
    return replace(model, sigmas=SigmaPlaces.sequential(list(of.views), list(of.stops), cameras, len(of.shared)))


def test_time_stamp_jitter_has_a_prior():
    """Time stamp jitter is expected to be a fifth of a millisecond within a factor of five, whatever the arms have."""
    model = _with_jitter(_model(), "wrist")
    prior = hyperpriors(model, REACH_M)
    plain = hyperpriors(_model(), REACH_M)
    assert len(prior.start) == 6
    np.testing.assert_allclose(np.exp(prior.start), [*np.exp(plain.start), 2e-4])
    off = prior.start + np.log(5.0) * np.eye(6)[5]
    assert prior.value(off)[0] - prior.value(prior.start)[0] == pytest.approx(1.0)


def test_jitter_is_ordered_between_stops_and_shared_errors():
    """Two cameras have their jitter in sequence, and all other priors are the same as without them."""
    shared = SharedErrors.repeat_coordinates(np.ones((8, 1)))
    common = SharedPrior((2.5, 2.0), "")
    plain = hyperpriors(_model(shared), REACH_M, [common])
    prior = hyperpriors(_with_jitter(_model(shared), "left", "right"), REACH_M, [common])
    np.testing.assert_allclose(np.exp(prior.start), [*np.exp(plain.start[:5]), 2e-4, 2e-4, *np.exp(plain.start[5:])])
    off = 0.3 * np.arange(11.0)
    without = np.delete(off, [5, 6])
    rises = [of.value(of.start + by)[0] - of.value(of.start)[0] for of, by in ((prior, off), (plain, without))]
    assert rises[0] - rises[1] == pytest.approx((off[5] ** 2 + off[6] ** 2) / np.log(5.0) ** 2)


@pytest.mark.parametrize(("field", "mean", "factor"), [
    ("pixel_px", 0.2, 5), ("pose_m", 1e-3, 5), ("pose_rad", 2e-3, 5), ("point_m", 1e-3, 5), ("touch_m", 2e-4, 4),
    ("grip_rad", 1e-3, 4),
])  # fmt: skip
def test_each_measurement_type_has_its_usual_noise(field, mean, factor):
    """Without scatter the usual noise is used, and exact points scatter by at least a two-hundredth of it."""
    found, sigma = _part_prior(field, 1e9, 0.0)
    assert (found, sigma) == (mean, pytest.approx(np.log(factor)))
    least, _ = _part_prior(field, 0.0, 1e6)
    assert least == pytest.approx(2 * 5e-3 * mean)


def test_empty_set_of_robots_has_no_prior():
    """A single robot has the usual prior of arms."""
    assert _pool_robots([], (3e-4, 4.0)) == []
    ((form, mean, sigma),) = _pool_robots([np.array([0.0, 1.0])], (3e-4, 4.0))
    np.testing.assert_allclose(form, [0.0, 1.0])
    assert (mean, sigma) == (pytest.approx(np.log(3e-4)), pytest.approx(np.log(4.0)))
