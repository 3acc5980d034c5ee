"""Tests of sparse normal equations for many robots, against dense ones."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from basecal.estimation.least_squares import bundle_adjustment
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.least_squares.normal_equations import linearise, retract
from basecal.estimation.least_squares.sparse_normal_equations import MANY_COLUMNS, is_sparse, sparse_bundle
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.geometry import SE3
from basecal.numerics.batch import take
from basecal.simulation import Scenario, simulate

SCENARIOS = {
    "exact robots": Scenario(layout="ring", robots=4, samples=50),
    "robots with noise": Scenario(layout="ring", robots=4, samples=45, robot_noise=(3e-4, 5e-4)),
    "priors and free lenses": Scenario(
        layout="grid", robots=4, samples=30, base="prior", target_mount="prior", intrinsics="free"
    ),
    "poses, a fixed mount": Scenario(layout="ring", robots=3, samples=31, target="pose", camera_mount="fixed"),
    "lights": Scenario(layout="ring", robots=3, samples=60, target="led", robot_noise=(1e-4, 1e-4)),
}


def problem_near_truth(scenario: Scenario, seed: int = 1):
    """A problem, and a state near the truth with stop errors."""
    made = simulate(scenario, seed)
    problem, _ = build_problem(made.cell, made.recording)
    rng = np.random.default_rng(seed)
    transforms = {
        name: pose
        @ SE3.exp(1e-3 * rng.standard_normal(6) * ([1, 1, 1, 0, 0, 0] if name in problem.point_mounts else 1))
        for name, pose in made.truth.items()
    }
    return problem, State(transforms, made.cameras, 0.3 * rng.standard_normal((len(problem.stops), 6)))


@pytest.mark.parametrize("name", SCENARIOS)
@pytest.mark.parametrize("weighted", [False, True])
def test_sparse_equations_and_steps_equal_dense_ones(name: str, weighted: bool) -> None:
    """Cost, gradient, Hessian, and the state after a step with stop errors agree. Views may have partial weights."""
    problem, state = problem_near_truth(SCENARIOS[name])
    rng = np.random.default_rng(0)
    weights = [rng.choice([0.0, 0.5, 1.0], len(g)) for g in problem.groups] if weighted else None
    dense, bundle = linearise(problem, state, weights), sparse_bundle(problem, weights)
    spread = state.repeat(problem, 1)
    sparse = bundle.linearise(spread)
    assert sparse.cost[0] == pytest.approx(dense.cost, rel=1e-12)
    size = np.abs(dense.hessian).max()
    np.testing.assert_allclose(sparse.gradient[0], dense.gradient, atol=1e-9 * np.abs(dense.gradient).max())
    np.testing.assert_allclose(sparse.hessian.matrix.toarray(), dense.hessian, atol=1e-12 * size)
    step = 1e-3 * rng.standard_normal(problem.width)
    after, expected = take(bundle.retract(spread, sparse, step[None]), 0), retract(problem, state, dense, step)
    np.testing.assert_allclose(after.stop_errors, expected.stop_errors, atol=1e-8)
    for key, pose in expected.transforms.items():
        np.testing.assert_allclose(after.transforms[key].matrix, pose.matrix, atol=1e-12)
    for key, camera in expected.cameras.items():
        np.testing.assert_allclose(after.cameras[key].parameters, camera.parameters)


def test_sparse_and_dense_descents_have_the_same_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both end at the same state, with the same information."""
    problem, state = problem_near_truth(SCENARIOS["robots with noise"])
    dense = bundle_adjust(problem, state, 1.0)
    monkeypatch.setattr(bundle_adjustment, "is_sparse", lambda problem: True)
    sparse = bundle_adjust(problem, state, 1.0)
    assert dense.sparse is None
    assert sparse.sparse is not None
    assert sparse.converged
    assert sparse.cost == pytest.approx(dense.cost, rel=1e-9)
    np.testing.assert_allclose(sparse.state.stop_errors, dense.state.stop_errors, atol=1e-4)
    np.testing.assert_allclose(
        sparse.normal.hessian, dense.normal.hessian, rtol=1e-3, atol=1e-3 * sparse.normal.hessian.max()
    )


@pytest.mark.parametrize(("changed", "sparse"), [
    ({}, True),
    ({"width": MANY_COLUMNS - 1}, False),
    ({"models": {"hand": None}}, False),
    ({"jitter_s": {"wrist": 1e-3}}, False),
    ({"shared_stops": np.array([-1, 0])}, False),
    ({"shared_stops": np.zeros(0)}, True),
])  # fmt: skip
def test_few_unknowns_and_tied_views_use_dense_equations(changed, sparse) -> None:
    """Few unknowns need dense equations.

    So do robot kinematics, time stamp jitter, and a stop that several views share, even the first.
    """
    many = {"width": MANY_COLUMNS, "models": {}, "jitter_s": {}, "tied": None, "shared_stops": np.array([-1, -1])}
    assert is_sparse(SimpleNamespace(**(many | changed))) == sparse
