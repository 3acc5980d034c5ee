"""A problem about a state as a mixed model leads to the optimum of the problem itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.estimation.noise.test_reml import NOISY, ROBOTS, at_truth

from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.noise.mixed_model import estimates_of, mixed_model
from basecal.estimation.noise.reml import posterior
from basecal.estimation.noise.robot_noise import stops_made, with_robot_noise, without_errors
from basecal.estimation.noise.terms.common_errors import CommonErrors


def test_step_leads_to_the_optimum():
    """At the optimum of the same sigmas the most likely unknowns are no step away, and errors of stops as they are."""
    problem, state = at_truth(NOISY)
    sigma = np.repeat([1e-3, 2e-3], 3)
    used = with_robot_noise(problem, dict.fromkeys(ROBOTS, sigma))
    end = bundle_adjust(used, without_errors(used, state), 100)
    physical = replace(end.state, stop_errors=end.state.stop_errors * used.stops.sigma)
    known = posterior(mixed_model(problem, physical, ROBOTS), np.log([1e-3, 2e-3] * 2))
    assert np.abs(known.step).max() < 1e-6
    np.testing.assert_allclose(known.stop_errors, physical.stop_errors, atol=1e-6)
    np.testing.assert_allclose(known.covariance, np.linalg.inv(end.normal.hessian), rtol=1e-3, atol=1e-11)


@pytest.mark.parametrize("arms", ["both", "stations", "halves"])
def test_views_in_two_groups_are_those_of_one(arms):
    """Sums, scatter and what all of it leads to do not depend on how the views of a camera are grouped."""
    problem, state = at_truth(replace(NOISY, arms=arms, state_pixel_noise=False))
    (group,) = problem.groups
    halves = problem.with_groups([group.take(np.arange(5)), group.take(np.arange(5, 8))])
    whole, parts = mixed_model(problem, state, ROBOTS), mixed_model(halves, state, ROBOTS)
    assert parts.white.keys() == whole.white.keys() == parts.parts.keys()
    of_views = estimates_of(problem, state)[0]["pixel_px"]
    assert whole.white["wrist", "pixel_px"] == (of_views.white, of_views.white_count)
    for key in whole.white:
        np.testing.assert_allclose(parts.white[key], whole.white[key], rtol=1e-9)
        for name in ("count", "cost", "fixed", "errors", "fixed_fixed", "errors_fixed", "errors_errors"):
            one, other = (np.asarray(getattr(of.parts[key], name)) for of in (whole, parts))
            np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-9 * np.abs(one).max())
    logs = np.log([0.3, 1e-3, 2e-3, 1e-3, 2e-3])
    one, other = posterior(whole, logs), posterior(parts, logs)
    assert other.value == pytest.approx(one.value, rel=1e-9)
    np.testing.assert_allclose(other.stop_errors, one.stop_errors, atol=1e-9)


@pytest.mark.parametrize("arms", ["both", "stations", "halves"])
def test_errors_of_stops_are_their_own_and_what_they_have_in_common(arms):
    """Own ones from blocks or from columns of stops that many views tie; errors in common by each robot's stops."""
    problem, state = at_truth(replace(NOISY, arms=arms))
    rng = np.random.default_rng(0)
    modes = {name: rng.standard_normal((stops_made(problem, name), 2)) for name in ROBOTS}
    shared = {name: CommonErrors.in_every_coordinate(of) for name, of in modes.items()}
    model = mixed_model(problem, state, ROBOTS, shared)
    errors, columns = rng.standard_normal(model.error_robot.shape), rng.standard_normal(len(model.prior))
    found, layout = model.stop_errors(errors, columns), model.layout
    number = dict.fromkeys(ROBOTS, 0)
    tied = 0
    for stop, robot in enumerate(problem.stops.robot):
        own = errors[layout.block[stop]][layout.row[stop] :][:6]
        if layout.column[stop] >= 0:
            own, tied = columns[layout.column[stop] :][:6], tied + 1
        first, common = layout.common[robot]
        own = own + common.by_stop[number[robot]] @ columns[first : first + 12]
        number[robot] += 1
        np.testing.assert_allclose(found[stop], own, rtol=1e-12)
    assert (tied > 0) == (arms == "halves")
    assert len(model.prior) == problem.width + 6 * tied + 24
    np.testing.assert_array_equal(np.diag(model.prior)[problem.width :], 1.0)
    assert model.common.sum() == 24
