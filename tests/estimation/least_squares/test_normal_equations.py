"""Tests of normal equations with eliminated stops, against the dense ones of all unknowns and stop errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.derivatives import check_derivative
from tests.pose_problem import MOUNT, pose_problem

from basecal.cell import Intrinsics, Unknown
from basecal.effects import joint_offsets
from basecal.estimation.least_squares.jacobians import stop_error_jacobians, unknown_jacobian
from basecal.estimation.least_squares.normal_equations import (
    LinearisedViews,
    linearise,
    prior_residuals,
    retract,
    retract_lens,
)
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem, State, chain
from basecal.estimation.problem.robot_parameters import Kinematics, robot_model
from basecal.geometry import SE3, Camera
from basecal.simulation import Scenario, simulate

NOISY = (2e-3, 3e-3)
# Views of a cell by their rows: repeated rows have the same stops of both robots.
PRIVATE, PAIRS, MIXED = [0, 1, 2, 3], [0, 0, 1, 1, 2, 2, 3, 3], [0, 1, 1, 2, 2, 2, 3]
CELLS = {
    "each at its own stop": (Scenario(samples=4, target="points", robot_noise=NOISY), PRIVATE),
    "all stops of two views": (Scenario(samples=4, target="points", robot_noise=NOISY), PAIRS),
    "some stops of several": (Scenario(samples=4, target="points", robot_noise=NOISY), MIXED),
    "eye still": (Scenario(samples=4, target="points", arms="eye_still", robot_noise=NOISY), PRIVATE),
    "a light": (Scenario(samples=4, target="led", target_mount="prior", robot_noise=NOISY), MIXED),
    "a lens": (Scenario(samples=4, target="points", intrinsics="free", robot_noise=NOISY), MIXED),
    "no noise": (Scenario(samples=4, target="points", base="prior"), PRIVATE),
    "so many views that factors pay": (Scenario(samples=70, target="points", robot_noise=NOISY), [*range(70)]),
    "two cameras": (Scenario(samples=4, target="points", layout="two_cameras", robot_noise=NOISY), MIXED),
    "a camera on the world": (Scenario(samples=4, target="points", layout="eye_to_hand", robot_noise=NOISY), MIXED),
    "a target on the world": (Scenario(samples=4, target="points", layout="eye_in_hand", robot_noise=NOISY), MIXED),
    "arms built otherwise": (
        Scenario(samples=4, target="points", joints=True, joint_offset_rad=4e-3, joint_offsets="prior",
                 link_error=(5e-4, 1e-3), link_parameters="prior", robot_noise=NOISY), MIXED,
    ),
    "a lens under a prior": (
        Scenario(samples=4, target="points", intrinsics="prior", camera_mount="prior", target_mount="fixed"), PRIVATE,
    ),
    "stamps that jitter": (Scenario(samples=4, target="points", robot_noise=NOISY), MIXED),
}  # fmt: skip
JITTER_S = 0.3


def problem_near_truth(scenario: Scenario, rows: list[int]) -> tuple[Problem, State]:
    """A problem of views at these rows, and a state off by 1 mm and mrad with stop errors of order one."""
    made = simulate(scenario, seed=4)
    problem, _ = build_problem(made.cell, made.recording)
    rng = np.random.default_rng(1)
    off = {name: t @ SE3.exp(1e-3 * rng.standard_normal(6)) for name, t in made.truth.items()}
    state = State(off, made.cameras, rng.standard_normal((len(problem.stops), 6)))
    return problem.with_groups(g.take(np.array(rows)) for g in problem.groups), state


def problem_of_cell(name: str) -> tuple[Problem, State]:
    """One of `CELLS`; with jitter, its views move by some centimetres and hundredths of a radian per second."""
    problem, state = problem_near_truth(*CELLS[name])
    if name != "stamps that jitter":
        return problem, state
    (group,) = problem.groups
    motion = 0.03 * np.random.default_rng(7).standard_normal((len(group), 6))
    moving = problem.with_groups([replace(group, motion=motion)])
    return replace(moving, jitter_s={group.camera: JITTER_S}), state


def dense_equations(problem: Problem, state: State):
    """Hessian and gradient of unknowns, followed by all stop errors."""
    p, k = problem.width, len(problem.stops)
    hessian, gradient = np.zeros((p + 6 * k,) * 2), np.zeros(p + 6 * k)
    hessian[p:, p:], gradient[p:] = np.eye(6 * k), state.stop_errors.ravel()
    for residual, jacobian, where in prior_residuals(problem, state):
        hessian[where, where] += jacobian.T @ jacobian
        gradient[where] += jacobian.T @ residual
    for group in problem.groups:
        links = chain(group, state, problem.stops)
        lens = group.camera in problem.columns
        view = group.measurement.linearise(links.camera_from_target, state.cameras.get(group.camera), lens)
        rows = view.gradient.shape[-1]
        if group.motion is not None:  # jitter is noise of a view's pose along its motion
            spread = np.linalg.inv(view.information)
            shaken = np.linalg.inv(spread + np.einsum("ni,nj->nij", *[JITTER_S * group.motion] * 2))
            gradient_of = (shaken @ spread @ view.gradient[..., None])[..., 0]
            view = view._replace(information=shaken, gradient=gradient_of)
        derivative, columns = unknown_jacobian(problem, group, links, state, rows)
        full = np.zeros((len(group), rows, p + 6 * k))
        full[..., columns] = derivative
        for stop, by_error in stop_error_jacobians(group, links, state, problem.stops, rows):
            for row, number in enumerate(stop):
                full[row, :, p + 6 * number : p + 6 * number + 6] += by_error[row]
        flat = full.reshape(-1, full.shape[-1])
        hessian += flat.T @ (view.information @ full).reshape(flat.shape)
        gradient += np.einsum("nqi,nq->i", full, view.gradient)
    return hessian, gradient


@pytest.mark.parametrize("name", CELLS)
def test_elimination_equals_the_dense_schur_complement(name):
    """Hessian, gradient, log determinant and the predicted decrease by errors agree to 1e-9 of their size.

    Any robot may share stops.
    """
    problem, state = problem_of_cell(name)
    hessian, gradient = dense_equations(problem, state)
    p, normal = problem.width, linearise(problem, state)
    solved = np.linalg.solve(hessian[p:, p:], np.column_stack([hessian[p:, :p], gradient[p:]]))
    reduced = np.column_stack([hessian[:p, :p], gradient[:p]]) - hessian[:p, p:] @ solved
    scale = np.sqrt(np.diag(hessian)[:p])
    np.testing.assert_allclose(
        normal.hessian / np.outer(scale, scale), reduced[:, :-1] / np.outer(scale, scale), atol=1e-9
    )
    size = np.abs(gradient[:p] / scale).max()
    np.testing.assert_allclose(normal.gradient / scale / size, reduced[:, -1] / scale / size, atol=1e-9)
    assert normal.stop_log_det == pytest.approx(np.linalg.slogdet(hessian[p:, p:])[1], abs=1e-8)
    used = np.unique(np.concatenate([s[s >= 0] for g in problem.groups for s in (g.eye.stop, g.hand.stop)]))
    promised = (gradient[p:] * solved[:, -1]).reshape(-1, 6)[used].sum()
    assert normal.eliminated_cost == pytest.approx(promised, rel=1e-9)


@pytest.mark.parametrize("name", CELLS)
def test_stop_errors_are_optimal_after_a_step(name):
    """The errors minimise the dense quadratic for the moved unknowns."""
    problem, state = problem_of_cell(name)
    hessian, gradient = dense_equations(problem, state)
    p = problem.width
    step = 1e-3 * np.random.default_rng(2).standard_normal(p)
    after = retract(problem, state, linearise(problem, state), step)
    best = -np.linalg.solve(hessian[p:, p:], gradient[p:] + hessian[p:, :p] @ step)
    used = np.unique(np.concatenate([s[s >= 0] for g in problem.groups for s in (g.eye.stop, g.hand.stop)]))
    np.testing.assert_allclose(
        (after.stop_errors - state.stop_errors)[used], best.reshape(-1, 6)[used], rtol=1e-7, atol=1e-7
    )


# Jitter weights depend on the motion at the state, which is not part of the second-order expansion.
SLOPES = [name for name in CELLS if name not in {"so many views that factors pay", "stamps that jitter"}]


@pytest.mark.parametrize("name", SLOPES)
def test_gradient_is_half_the_slope_of_the_cost(name):
    """The slope is by finite differences along a direction of all unknowns, after the stop errors were optimised."""
    problem, state = problem_of_cell(name)
    for _ in range(4):
        state = retract(problem, state, linearise(problem, state), np.zeros(problem.width))
    normal = linearise(problem, state)
    way = np.random.default_rng(3).standard_normal(problem.width) / np.sqrt(np.diag(normal.hessian))

    def half_cost(size: np.ndarray) -> np.ndarray:
        moved = retract(problem, state, normal, size[0] * way)
        return np.array([0.5 * linearise(problem, replace(moved, stop_errors=state.stop_errors)).cost])

    check_derivative(half_cost, (normal.gradient @ way)[None, None], 1e-2, 1e-6)


@pytest.mark.parametrize("name", ["each at its own stop", "all stops of two views", "no noise"])
def test_views_of_zero_weight_have_no_effect(name):
    """Cost, Hessian and gradient are those of the other views alone, including the private errors of their stops."""
    problem, state = problem_near_truth(*CELLS[name])
    rows = np.arange(2, len(problem.groups[0]))
    fewer = problem.with_groups(g.take(rows) for g in problem.groups)
    used = np.unique(np.concatenate([s for g in fewer.groups for s in (g.eye.stop, g.hand.stop)]))
    errors = state.stop_errors.copy()
    if len(errors) and not np.any(problem.shared_stops >= 0):
        errors[np.setdiff1d(np.arange(len(errors)), used)] = 0.0
    weighted = linearise(problem, state, [(np.arange(len(problem.groups[0])) >= 2).astype(float)])
    alone = linearise(fewer, replace(state, stop_errors=errors))
    assert weighted.cost == pytest.approx(alone.cost, rel=1e-12)
    np.testing.assert_allclose(weighted.hessian, alone.hessian, rtol=1e-9, atol=1e-9 * np.abs(alone.hessian).max())
    np.testing.assert_allclose(weighted.gradient, alone.gradient, rtol=1e-9, atol=1e-9 * np.abs(alone.gradient).max())
    # Shared stops without visible views keep their errors, whose predicted decrease is not part of the views'.
    unseen = np.setdiff1d(np.arange(len(errors)), used) if np.any(problem.shared_stops >= 0) else []
    promised = alone.eliminated_cost + np.sum(state.stop_errors[unseen] ** 2)
    assert weighted.eliminated_cost == pytest.approx(promised, rel=1e-9)


@pytest.mark.parametrize("name", ["each at its own stop", "all stops of two views", "some stops of several"])
def test_step_reduces_the_cost_as_predicted(name):
    """The predicted decrease by unknowns and errors holds within a tenth.

    The errors contribute more than a tenth of the unknowns' part.
    """
    problem, state = problem_near_truth(*CELLS[name])
    state = replace(state, stop_errors=0.3 * state.stop_errors)
    normal = linearise(problem, state)
    step = -np.linalg.solve(normal.hessian, normal.gradient)
    of_unknowns = float(step @ normal.hessian @ step)
    fallen = normal.cost - linearise(problem, retract(problem, state, normal, step)).cost
    assert fallen == pytest.approx(of_unknowns + normal.eliminated_cost, rel=0.1)
    assert normal.eliminated_cost > 0.1 * of_unknowns


def test_weight_of_two_counts_a_view_twice():
    """A weight of two equals a repeated view if robots have no noise."""
    problem, state = problem_near_truth(*CELLS["no noise"])
    twice = linearise(problem.with_groups(g.take(np.array([0, 1, 1, 2, 3])) for g in problem.groups), state)
    weighted = linearise(problem, state, [np.array([1.0, 2.0, 1.0, 1.0])])
    assert weighted.cost == pytest.approx(twice.cost, rel=1e-12)
    np.testing.assert_allclose(weighted.hessian, twice.hessian, rtol=1e-12, atol=1e-12 * np.abs(twice.hessian).max())


def test_private_errors_are_weighted_like_their_view():
    """A pose off by a metre with a stop error of two sigmas: half the weight has half the cost of both."""
    problem, state = pose_problem(np.eye(6)[:1], np.ones(6), stop_sigma=np.full(6, 1e-9))
    state = replace(state, stop_errors=np.array([[2.0, 0, 0, 0, 0, 0]]))
    assert linearise(problem, state).cost == pytest.approx(1.0 + 4.0)
    assert linearise(problem, state, [np.array([0.5])]).cost == pytest.approx(0.5 + 2.0)


def test_zero_weight_view_behind_the_camera_has_finite_cost():
    """A view behind the camera costs nothing without weight, and infinitely much with any weight."""
    problem, state = problem_near_truth(*CELLS["no noise"])
    (group,) = problem.groups
    far = group.measurement.points_in_target - 50 * state.camera_from_target(group, problem.stops)[0].rotation[2]
    lost = problem.with_groups([replace(group, measurement=replace(group.measurement, points_in_target=far))])
    assert linearise(lost, state).cost == np.inf
    assert np.isfinite(linearise(lost, state, [np.zeros(4)]).cost)


def test_priors_are_in_sigmas():
    """A prior's residual is in sigmas.

    A mount half a millimetre from its mean with 1 mm sigma has half a sigma, in its own columns only.
    """
    sigma = np.array([1e-3, 2e-3, 4e-3, 0.1, 0.2, 0.4])
    problem, state = pose_problem(np.zeros((2, 6)), np.ones(6), Unknown("prior", SE3.identity(), sigma))
    xi = np.array([5e-4, 0, 0, 0.02, 0, 0])
    moved = replace(state, transforms={**state.transforms, MOUNT: SE3.exp(xi)})
    ((residual, jacobian, where),) = prior_residuals(problem, moved)
    np.testing.assert_allclose(residual, xi / sigma, atol=1e-12)
    assert where == slice(0, 6)

    def of(step: np.ndarray) -> np.ndarray:
        after = replace(state, transforms={**state.transforms, MOUNT: SE3.exp(xi) @ SE3.exp(1e-3 * step)})
        return prior_residuals(problem, after)[0][0]

    check_derivative(of, 1e-3 * jacobian, 1e-2, 1e-9)
    point = replace(problem, columns={MOUNT: slice(0, 3)})
    assert [part.shape for part in prior_residuals(point, moved)[0][:2]] == [(3,), (3, 3)]
    for guess in (None, SE3.identity()):
        free = replace(problem, unknowns={**problem.unknowns, MOUNT: Unknown(mean=guess)})
        assert prior_residuals(free, moved) == []


def test_lens_priors_are_in_sigmas():
    """Parameters with a prior are divided by their sigmas.

    A free lens has residuals for the terms that are small in real lenses, if any.
    """
    lens = Camera("pinhole", np.array([800.0, 800, 320, 240]))
    problem, state = pose_problem(np.zeros((2, 6)), np.ones(6))
    sigma = np.array([1.0, 2.0, 4.0, 8.0])
    known = replace(problem, columns={"camera": slice(0, 4)}, lenses={"camera": Intrinsics("prior", lens, sigma)})
    moved = replace(state, cameras={"camera": lens.with_parameters(lens.parameters + 2.0)})
    ((residual, jacobian, _),) = prior_residuals(known, moved)
    np.testing.assert_allclose(residual, [2.0, 1.0, 0.5, 0.25])
    np.testing.assert_allclose(jacobian, np.diag(1 / sigma))
    free = replace(known, lenses={"camera": Intrinsics("free")})
    assert prior_residuals(free, moved) == []
    fixed = replace(known, lenses={"camera": Intrinsics("fixed", lens)})
    assert prior_residuals(fixed, moved) == []
    bent = Camera("pinhole", [800.0, 800, 320, 240, 0.1, 0.2, 0.3, 0.4, 0.5])
    held = np.flatnonzero(np.isfinite(bent.term_sigmas))
    found = prior_residuals(replace(free, columns={"camera": slice(0, 9)}), replace(state, cameras={"camera": bent}))
    assert len(found) == (len(held) > 0)
    for residual, jacobian, where in found:
        np.testing.assert_allclose(residual, bent.distortion[held] / bent.term_sigmas[held])
        np.testing.assert_allclose(jacobian, np.eye(9)[4 + held] / bent.term_sigmas[held, None])
        assert where == slice(0, 9)


def test_focal_lengths_stay_above_a_fifth_and_finite():
    """A step to a tenth ends at a fifth, a non-finite step has no effect, and the others are added."""
    lens = Camera("pinhole", np.array([800.0, 900, 320, 240, 0.1, 0, 0, 0, 0]))
    step = np.array([-720.0, 10, np.nan, 5, 0.2, 0, np.inf, 0, 0])
    np.testing.assert_allclose(retract_lens(lens, step).parameters, [160, 910, 320, 245, 0.3, 0, 0, 0, 0])
    np.testing.assert_allclose(lens.parameters[:2], [800, 900])


def test_joint_priors_are_in_sigmas():
    """Each offset is divided by its stated sigma, and free offsets have no prior.

    For arms with both statuses, only the prior counts.
    """
    made = simulate(Scenario(samples=6, joints=True, camera_mount="fixed", target_mount="fixed"), 0)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    prior = {"joint_offsets": joint_offsets.Stated(status="prior", sigma_rad=0.01)}
    free = {"joint_offsets": joint_offsets.Stated(status="free")}
    chain_of = {name: made.cell.robots[name].chain for name in ("eye", "hand")}
    models = {
        "eye": robot_model("eye", chain_of["eye"], prior, group.eye.joints),
        "hand": robot_model("hand", chain_of["hand"], free, group.hand.joints),
    }
    problem = problem.with_models(models)
    values = np.array([0.01, -0.02, 0.0, 0.005, 0.0, 0.03])
    robots = {name: Kinematics(chain_of[name], {"joint_offsets": values}) for name in models}
    state = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)), robots)
    ((residual, jacobian, where),) = prior_residuals(problem, state)
    np.testing.assert_allclose(residual, values / 0.01)
    np.testing.assert_allclose(jacobian, np.eye(6) / 0.01)
    assert where == problem.columns["eye_joint_offsets"]
    held = problem.columns["hand_joint_offsets"]
    assert held.stop - held.start == len(models["hand"].columns["joint_offsets"].basis.T)


@pytest.mark.parametrize("batch", [(), (2,)])
def test_weights_scale_views_and_zero_removes_them(rng, batch):
    """Gradient, information and predicted decrease are scaled for each view.

    With weight zero even NaN has no effect.
    """
    gradient, root = rng.standard_normal((*batch, 3, 6)), rng.standard_normal((*batch, 3, 6, 6))
    promised = rng.uniform(1, 2, (*batch, 3))
    views = LinearisedViews(gradient, root @ root.mT, promised, np.zeros((*batch, 3, 6, 0)), np.zeros(0, int), (), ())
    weight = np.broadcast_to([0.5, 1.0, 3.0], (*batch, 3))
    names = ("gradient", "information", "eliminated_cost")
    for name in names:
        plain, found = getattr(views, name), getattr(views.weigh(weight), name)
        np.testing.assert_allclose(
            np.moveaxis(found, len(batch), 0),
            [k * np.take(plain, i, len(batch)) for i, k in enumerate((0.5, 1.0, 3.0))],
        )
    lost = np.array([False, True, False])
    wild = {
        name: np.where(lost.reshape(3, *[1] * k), np.nan, getattr(views, name))
        for k, name in zip((1, 2, 0), names, strict=True)
    }
    found = replace(views, **wild).weigh(np.where(lost, 0.0, weight))
    expected = views.weigh(np.where(lost, 0.0, weight))
    for name in names:
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
        assert not np.take(getattr(found, name), 1, len(batch)).any()


@pytest.mark.parametrize("count", [1, 70])
def test_extreme_view_weights_leave_the_others_unchanged(count):
    """A weight so large that rounding removes the identity of the stop errors gives finite results.

    The other views are exact.
    """
    problem, state = pose_problem(np.full((count + 1, 6), 1e-6), np.ones(6), stop_sigma=np.full(6, 1.0))
    (group,) = problem.groups
    plain = linearise(problem, state)
    wild = np.where(np.arange(count + 1) == 0, 1e12, 1.0)[:, None] * group.measurement.weight
    mixing = SE3.exp(np.array([3.0, -2.0, 1.0, 1.0, 2.0, 0.5]))  # makes information singular except for rounding
    off = SE3.stack([mixing, *[SE3.identity()] * count])
    measured = replace(
        group.measurement, weight=wild, measured_camera_from_target=group.measurement.measured_camera_from_target @ off
    )
    normal = linearise(problem.with_groups([replace(group, measurement=measured)]), state)
    assert np.isfinite(normal.hessian).all()
    assert np.isfinite(normal.stop_log_det)
    for name in ("gradient", "information"):
        np.testing.assert_allclose(
            getattr(normal.views[0], name)[1:], getattr(plain.views[0], name)[1:], rtol=1e-9, atol=1e-15
        )
