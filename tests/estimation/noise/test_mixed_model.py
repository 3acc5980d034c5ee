"""Tests of mixed models of a problem about a state, against the problem's own optimum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.ends import with_eye, with_hand
from tests.estimation.noise.test_reml import NOISY, ROBOTS, problem_at_truth
from tests.pose_problem import CHAINED, EXACT, MOUNT, OWN, SINGLE, STAR, pose_problem, shaken, two_arm_problem

from basecal.cell import Unknown
from basecal.effects.faces.shared_errors import SharedErrors
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.least_squares.jacobians import stop_error_jacobians, unknown_jacobian
from basecal.estimation.noise.layout import Layout
from basecal.estimation.noise.mixed_model import _scene_moments, make_estimates, mixed_model
from basecal.estimation.noise.reml import posterior
from basecal.estimation.noise.robot_noise import count_stops, with_robot_noise, without_errors
from basecal.estimation.problem.problem import chain
from basecal.geometry import SE3
from tied_scene import tracks_alone


def test_mixed_model_step_is_zero_at_the_optimum():
    """At the optimum of the same sigmas, the most likely unknowns are no step away, and stop errors are unchanged."""
    problem, state = problem_at_truth(NOISY)
    sigma = np.repeat([1e-3, 2e-3], 3)
    used = with_robot_noise(problem, dict.fromkeys(ROBOTS, sigma))
    end = bundle_adjust(used, without_errors(used, state), 100)
    physical = replace(end.state, stop_errors=end.state.stop_errors * used.stops.sigma)
    known = posterior(mixed_model(problem, physical, ROBOTS), np.log([1e-3, 2e-3] * 2))
    assert np.abs(known.step).max() < 1e-6
    np.testing.assert_allclose(known.stop_errors, physical.stop_errors, atol=1e-6)
    np.testing.assert_allclose(known.covariance, np.linalg.inv(end.normal.hessian), rtol=1e-3, atol=1e-11)


@pytest.mark.parametrize("arms", ["both", "stations", "halves"])
def test_grouping_of_views_has_no_effect(arms):
    """Sums, scatter and the posterior do not depend on how the views of a camera are grouped."""
    problem, state = problem_at_truth(replace(NOISY, arms=arms, state_pixel_noise=False))
    (group,) = problem.groups
    halves = problem.with_groups([group.take(np.arange(5)), group.take(np.arange(5, 8))])
    whole, parts = mixed_model(problem, state, ROBOTS), mixed_model(halves, state, ROBOTS)
    assert parts.white.keys() == whole.white.keys() == parts.parts.keys()
    of_views = make_estimates(problem, state)[0]["pixel_px"]
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
def test_stop_errors_are_own_plus_shared_errors(arms):
    """Own errors are from blocks, or from columns for stops that many views connect.

    Shared errors are by each robot's stops.
    """
    problem, state = problem_at_truth(replace(NOISY, arms=arms))
    rng = np.random.default_rng(0)
    modes = {name: rng.standard_normal((count_stops(problem, name), 2)) for name in ROBOTS}
    shared = {name: SharedErrors.repeat_coordinates(of) for name, of in modes.items()}
    model = mixed_model(problem, state, ROBOTS, [shared])
    errors, columns = rng.standard_normal(model.of_errors.shape), rng.standard_normal(len(model.prior))
    found, layout = model.stop_errors(errors, columns), model.layout
    number = dict.fromkeys(ROBOTS, 0)
    tied = 0
    for stop, robot in enumerate(problem.stops.robot):
        own = errors[layout.block[stop]][layout.row[stop] :][:6]
        if layout.column[stop] >= 0:
            own, tied = columns[layout.column[stop] :][:6], tied + 1
        first, common = layout.shared[0][robot]
        own = own + common.by_stop[number[robot]] @ columns[first : first + 12]
        number[robot] += 1
        np.testing.assert_allclose(found[stop], own, rtol=1e-12)
    assert (tied > 0) == (arms == "halves")
    assert len(model.prior) == problem.width + 6 * tied + 24
    np.testing.assert_array_equal(np.diag(model.prior)[problem.width :], 1.0)
    places = [of.start + k for of in model.sigmas.shared[0].values() for k in (0, 1)]
    assert np.isin(model.of_columns, places).sum() == 24


def view_derivative(problem, layout, view, motion, common):
    """The derivative of a view near the identity by the columns, (6, m), and by the errors in its block, (6, q)."""
    (group,) = problem.groups
    columns, errors = np.zeros((6, layout.width)), np.zeros((6, layout.rows))
    columns[:, : problem.width] = -np.eye(6, problem.width)
    for sign, end in zip((-1, 1), group.ends, strict=True):
        stop, stand, robot = end.stop[view], end.stop_number[view], end.robot
        if stop < 0:
            continue
        in_columns = layout.block[stop] < 0
        at = layout.column[stop] if in_columns else layout.row[stop]
        (columns if in_columns else errors)[:, at : at + 6] += sign * np.eye(6)
        if robot in common:
            first, shared = layout.shared[0][robot]
            columns[:, first : first + len(shared.is_turn)] += sign * shared.by_stop[stand]
    ((_, row),) = layout.jitter_rows
    if row[view] >= 0:
        errors[:, row[view]] = motion[view]
    return columns, errors


@pytest.mark.parametrize("stops", [OWN, CHAINED, STAR, EXACT, SINGLE], ids=["own", "tied", "star", "exact", "single"])
@pytest.mark.parametrize(
    ("known_s", "robots_in_common", "mount"),
    [(None, (), "free"), (0.0, ("eye",), "free"), (2.0, ROBOTS, "free"), (None, ROBOTS, "fixed")],
)
def test_moments_are_sums_over_views(stops, known_s, robots_in_common, mount, rng):
    """Moments are products of residuals and derivatives for poses near the identity.

    They are about the state without stop errors.
    """
    views = len(stops[0])
    residual = 1e-6 * rng.standard_normal((views, 6))
    problem, state = two_arm_problem(-residual, *stops)
    state = replace(state, stop_errors=1e-6 * rng.standard_normal(state.stop_errors.shape))
    problem = problem if mount == "free" else replace(problem, columns={})
    motion = None
    if known_s is not None:
        problem, motion = shaken(problem, views, known_s)
        motion = motion * (known_s or 1.0)
    common = {
        robot: SharedErrors(rng.standard_normal((count_stops(problem, robot), 6, 3)), np.array([False, True, True]))
        for robot in robots_in_common
        if robot in problem.stops.robot
    }
    model = mixed_model(problem, state, ROBOTS, [common])
    layout = model.layout
    ((jitter, _),) = layout.jitter_rows
    (group,) = problem.groups
    for name, own in (("pose_m", np.repeat([1.0, 0.0], 3)), ("pose_rad", np.repeat([0.0, 1.0], 3))):
        part = model.parts["camera", name]
        fixed, fixed_fixed = np.zeros(layout.width), np.zeros((layout.width, layout.width))
        errors = np.zeros((layout.blocks, layout.rows))
        across = np.zeros((*errors.shape, layout.width))
        errors_errors = np.zeros((*errors.shape, layout.rows))
        for view in range(views):
            x, z = view_derivative(problem, layout, view, motion, common)
            of_stops = [end.stop[view] for end in group.ends if end.stop[view] >= 0]
            block = max([jitter[view], *layout.block[of_stops].tolist()])
            fixed += x.T @ (own * residual[view])
            fixed_fixed += x.T @ (own[:, None] * x)
            if block >= 0:
                errors[block] += z.T @ (own * residual[view])
                across[block] += z.T @ (own[:, None] * x)
                errors_errors[block] += z.T @ (own[:, None] * z)
        assert part.count == pytest.approx(3 * views)
        assert part.cost == pytest.approx(np.sum(own * residual**2), rel=1e-4)
        for found, expected in (
            (part.fixed, fixed), (part.errors, errors), (part.fixed_fixed, fixed_fixed),
            (part.errors_fixed, across), (part.errors_errors, errors_errors),
        ):  # fmt: skip
            np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4 * np.abs(expected).max(initial=1e-9))


def test_shared_stop_errors_of_a_scene():
    """An error shared by all stops of an arm moves the tracks as the same error of each of them."""
    _, _, problem, state = tracks_alone(1)
    assert problem.tied is not None
    stops, first = len(problem.stops), problem.width + 6 * len(problem.stops)
    shared = SharedErrors(np.tile(np.eye(6), (count_stops(problem, "left"), 1, 1)), np.repeat([False, True], 3))
    nowhere, column = np.full(stops, -1), problem.width + 6 * np.arange(stops)
    layout = Layout(nowhere, nowhere, column, np.array([6]), first + 6, ({"left": (first, shared)},), {}, ())
    of = _scene_moments(problem, problem.tied, state, layout)
    own = column[np.array(problem.stops.robot) == "left"][:, None] + np.arange(6)
    assert len(own) > 1
    for moment in (of.fixed, of.fixed_fixed):
        np.testing.assert_allclose(moment[first:], moment[own].sum(0), rtol=1e-6, atol=1e-6 * np.abs(moment).max())


def test_sigmas_are_assigned_to_columns_and_errors():
    """Shifts and rotations of each open robot are in blocks and columns, then jitter, then terms by their type."""
    problem, state = two_arm_problem(np.zeros((6, 6)), *STAR)
    problem, _ = shaken(problem, 6)
    shared = SharedErrors(np.ones((2, 6, 3)), np.array([False, True, True]))
    model = mixed_model(problem, state, ("hand",), [{"hand": shared}])
    v, none = len(model.sigmas.views), [-1] * 6
    shift_and_turn = [v] * 3 + [v + 1] * 3
    assert model.of_columns.tolist() == none + shift_and_turn + [v + 3, v + 4, v + 4]
    assert model.of_errors.tolist() == [[*none, v + 2, *none]] * 5 + [[*none, *shift_and_turn, v + 2]]
    of_both = mixed_model(problem, state, ROBOTS, [{"hand": shared}])
    of_hand = [v + 2] * 3 + [v + 3] * 3
    assert of_both.of_columns.tolist() == none + of_hand + [v + 7, v + 8, v + 8]
    assert of_both.of_errors.tolist() == [[*shift_and_turn, v + 4, *none]] * 5 + [[*shift_and_turn, *of_hand, v + 4]]
    (group,) = problem.groups
    second = with_hand(with_eye(replace(group, camera="another"), stop=np.full(6, -1)), stop=np.full(6, -1))
    of_two = replace(problem.with_groups([group, second]), open_jitter=frozenset({"another", "camera"}))
    found = mixed_model(of_two, state, ROBOTS)
    another, camera = (found.sigmas.jitter[name] for name in ("another", "camera"))
    assert found.of_errors[np.arange(12), [0] * 6 + [6] * 5 + [12]].tolist() == [another] * 6 + [camera] * 6
    assert (tuple(of_both.sigmas.stops), of_both.robot_of_stop) == (ROBOTS, problem.stops.robot)


def test_prior_is_that_of_the_state():
    """A mount a thousandth of a sigma off costs the same in each coordinate. Errors have unit variance about zero."""
    sigma = np.array([1e-3, 2e-3, 3e-3, 1e-3, 2e-3, 4e-3])
    known = Unknown("prior", SE3.exp(np.zeros(6)), sigma)
    problem, state = pose_problem(np.zeros((3, 6)), None, known, np.ones(6))
    state = replace(state, transforms={**state.transforms, MOUNT: SE3.exp(1e-3 * sigma)})
    shared = {"eye": SharedErrors.repeat_coordinates(np.ones((3, 1)))}
    model = mixed_model(problem, state, ("eye",), [shared])
    np.testing.assert_allclose(model.prior, np.diag([*sigma**-2, *[1.0] * 6]), rtol=1e-4, atol=10.0)
    np.testing.assert_array_equal(model.prior[6:], np.eye(12)[6:])
    np.testing.assert_allclose(model.prior_gradient, [*1e-3 / sigma, *[0.0] * 6], rtol=1e-3, atol=1e-6)
    assert model.prior_cost == pytest.approx(6e-6, rel=1e-3)


def test_shape_has_its_own_columns(rng):
    """The columns are the last ones and sum over all views. The prior is the previous shape with unit variance."""
    problem, state = problem_at_truth(replace(NOISY, samples=3, target="chessboard", state_pixel_noise=False))
    problem = replace(problem, shapes={"board": np.array([1.0, -2.0, 0.5])})
    model = mixed_model(problem, state, ROBOTS)
    shape = model.layout.shapes["board"]
    assert (shape, model.width) == (slice(18, 21), 18)
    (view,) = make_estimates(problem, state)[0].values()
    (part,) = model.parts.values()
    np.testing.assert_allclose(part.fixed[shape], view.gradient[:, 6:].sum(0), rtol=1e-12)
    np.testing.assert_allclose(part.fixed_fixed[shape, shape], view.information[:, 6:, 6:].sum(0), rtol=1e-12)
    (group,) = problem.groups
    by_unknown, columns = unknown_jacobian(problem, group, chain(group, state, problem.stops), state, 6)
    both = np.einsum("nij,nik->jk", by_unknown, view.information[:, :6, 6:])
    np.testing.assert_allclose(part.fixed_fixed[columns, shape], both, rtol=1e-9, atol=1e-9 * np.abs(both).max())
    np.testing.assert_array_equal(part.fixed_fixed[shape, :18], part.fixed_fixed[:18, shape].T)
    across = part.errors_fixed[:, :6, shape]
    of_eye = stop_error_jacobians(group, chain(group, state, problem.stops), state, problem.stops, 6)[0][1]
    expected = of_eye.mT @ view.information[:, :6, 6:]
    np.testing.assert_allclose(across, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_array_equal(model.prior_gradient[shape], problem.shapes["board"])
    np.testing.assert_array_equal(model.prior[18:, 18:], np.eye(3))
    assert model.prior_cost == 1.0 + 4.0 + 0.25


def test_views_in_one_block_are_added(monkeypatch):
    """Views added one by one, or in one chunk, give the same sums, and a block may have several views."""
    problem, state = two_arm_problem(1e-3 * np.random.default_rng(2).standard_normal((4, 6)), *CHAINED)
    together = mixed_model(problem, state, ROBOTS).parts["camera", "pose_m"]
    monkeypatch.setattr("basecal.estimation.noise.layout._CHUNK_NUMBERS", 1)
    apart = mixed_model(problem, state, ROBOTS).parts["camera", "pose_m"]
    for name in ("errors", "errors_fixed", "errors_errors"):
        np.testing.assert_allclose(getattr(apart, name), getattr(together, name), rtol=1e-12, atol=1e-15)


def test_targets_without_a_shape_have_no_shape_columns():
    """Targets with too few points, and measured poses, have none either."""
    problem, state = problem_at_truth(replace(NOISY, samples=3, target="chessboard", state_pixel_noise=False))
    (of_poses,) = pose_problem(np.zeros((3, 6)), None)[0].groups
    few = problem.with_groups([replace(problem.groups[0], measurement=of_poses.measurement)])
    (of_board,), (of_poses,) = (make_estimates(of, state) for of in (problem, few))
    points, state_of_points = problem_at_truth(replace(NOISY, samples=3, target="points", state_pixel_noise=False))
    (of_points,) = make_estimates(points, state_of_points)
    assert of_points["pixel_px"].gradient.shape == (3, 6)
    assert of_board["pixel_px"].gradient.shape == (3, 9)
    assert of_poses["pose_m"].gradient.shape == (3, 6)


def test_jitter_moves_the_view_but_not_the_lens(rng):
    """Jitter does not affect the lens, also if the lens is free."""
    problem, state = problem_at_truth(replace(NOISY, samples=3, intrinsics="free", state_pixel_noise=False))
    motion = rng.standard_normal((3, 6))
    moving = replace(problem.with_groups([replace(problem.groups[0], motion=motion)]), open_jitter=frozenset({"wrist"}))
    (part,) = mixed_model(moving, state, ROBOTS).parts.values()
    (view,) = make_estimates(moving, state)[0].values()
    expected = np.einsum("ni,nij,nj->n", motion, view.information[:, :6, :6], motion)
    np.testing.assert_allclose(part.errors_errors[:, -1, -1], expected, rtol=1e-9)
    across = np.einsum("nij,nj->ni", view.information[:, 6:15, :6], motion)
    lens = problem.columns["wrist"]
    np.testing.assert_allclose(
        part.errors_fixed[:, -1, lens], across[:, : lens.stop - lens.start], rtol=1e-9, atol=1e-9 * np.abs(across).max()
    )
