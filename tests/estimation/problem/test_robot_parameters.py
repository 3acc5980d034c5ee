"""Tests of robot parameters as columns: derivatives, and agreement with a dense solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.derivatives import check_derivative
from tests.oracles.dense import DenseProblem

from basecal.cell import RobotState
from basecal.effects import deflection, joint_offsets, link_parameters
from basecal.errors import InputError
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust, bundle_adjust_batch
from basecal.estimation.least_squares.jacobians import robot_model_jacobian
from basecal.estimation.least_squares.normal_equations import linearise, retract
from basecal.estimation.problem.build import build_problem, free_ends
from basecal.estimation.problem.problem import State, chain
from basecal.estimation.problem.robot_parameters import (
    Kinematics,
    apply_step,
    column_derivative,
    column_values,
    robot_model,
)
from basecal.estimation.solve import solve
from basecal.numerics.batch import take
from basecal.simulation import Scenario, simulate

ARMS = Scenario(samples=20, joints=True, target="points")
OFFSETS = {"joint_offset_rad": 0.004, "joint_offsets": "prior"}
LINKS = {"link_error": (5e-4, 1e-3), "link_parameters": "prior"}
GIVING = {"compliance": 1e-4, "deflection": "prior"}
_PER_NEWTON_METRE = 0.02  # so that a unit step turns joints by about a radian
NOISY = {"robot_noise": (2e-4, 3e-4)}
FREE_DEFLECTION = deflection.Stated(status="free")


def test_single_joint_is_selected(arm, joints):
    """The columns and sigmas of one joint remain of all with a prior. Other types are unchanged."""
    stated = {"joint_offsets": joint_offsets.Stated(status="prior", sigma_rad=0.01), "deflection": FREE_DEFLECTION}
    model = robot_model("hand", arm, stated, joints)
    one = model.select_joint("joint_offsets", 2)
    assert model.widths == {"hand_joint_offsets": 6, "hand_deflection": 4}
    assert one.widths == {"hand_joint_offsets": 1, "hand_deflection": 4}
    assert np.flatnonzero(one.columns["joint_offsets"].basis).tolist() == [2]
    assert one.sigmas["hand_joint_offsets"].tolist() == [0.01]
    assert one.sigmas["hand_deflection"] is None


@pytest.mark.parametrize(
    ("scenario", "robot", "ends"),
    [
        (ARMS, "hand", (True, True)),
        (ARMS, "eye", (True, True)),
        (replace(ARMS, base="prior"), "hand", (False, True)),
        (replace(ARMS, base="fixed", camera_mount="fixed"), "eye", (False, False)),
        (replace(ARMS, target_mount="prior"), "hand", (True, False)),
        (replace(ARMS, layout="eye_in_hand", target_mount="fixed"), "arm", (False, True)),
        (replace(ARMS, layout="eye_to_hand"), "arm", (True, True)),
    ],
)
def test_end_is_free_if_all_its_transforms_are(scenario, robot, ends):
    """The base end is a base, or for the reference everything else in the world.

    The other end is all that a flange carries.
    """
    made = simulate(scenario, seed=0)
    assert free_ends(build_problem(made.cell, made.recording)[0], robot) == ends


@pytest.mark.journey
def test_columns_are_derivatives_of_the_flange(arm, joints):
    """Columns equal finite differences at large offsets, link errors and compliances, for all at once."""
    rng = np.random.default_rng(1)
    stated = {
        "joint_offsets": joint_offsets.Stated(status="prior", sigma_rad=0.01),
        "link_parameters": link_parameters.Stated(status="free"),
        "deflection": deflection.Stated(status="free", down=[0.3, 0.0, -4.0]),
    }
    model = robot_model("hand", arm, stated, joints, (True, True))
    sizes = {"joint_offsets": (0.1, (6,)), "link_parameters": (0.1, (7, 6)), "deflection": (1e-3, (6,))}
    at = Kinematics(arm, {k: size * rng.standard_normal(shape) for k, (size, shape) in sizes.items()}, stated)
    before = at.forward(joints).inverse()

    def after(step):
        parts = dict(zip(model.widths, np.split(step, np.cumsum([*model.widths.values()])[:-1]), strict=True))
        parts["hand_deflection"] = _PER_NEWTON_METRE * parts["hand_deflection"]
        return (before @ apply_step(model, at, parts).forward(joints)).log()

    derivative = column_derivative(model, at, joints)
    derivative[..., -model.widths["hand_deflection"] :] *= _PER_NEWTON_METRE
    check_derivative(after, derivative)


def test_batch_of_kinematics_equals_separate_kinematics(arm, joints):
    """Flange, columns and steps are correct for arms with different parameters."""
    rng = np.random.default_rng(2)
    stated = {
        "joint_offsets": joint_offsets.Stated(status="prior", sigma_rad=0.01),
        "link_parameters": link_parameters.Stated(status="free"),
        "deflection": FREE_DEFLECTION,
    }
    model = robot_model("hand", arm, stated, joints)
    sizes = {"joint_offsets": (0.1, (6,)), "link_parameters": (0.1, (7, 6)), "deflection": (1e-3, (6,))}
    many = Kinematics(arm, {k: size * rng.standard_normal((3, *shape)) for k, (size, shape) in sizes.items()}, stated)
    steps = {name: 1e-3 * rng.standard_normal((3, width)) for name, width in model.widths.items()}
    after = apply_step(model, many, steps)
    for k in range(3):
        alone = Kinematics(arm, {kind: values[k] for kind, values in many.values.items()}, stated)
        np.testing.assert_allclose(many.forward(joints).matrix[k], alone.forward(joints).matrix, atol=1e-14)
        columns = column_derivative(model, alone, joints)
        np.testing.assert_allclose(
            column_derivative(model, many, joints)[k], columns, atol=1e-13 * np.abs(columns).max()
        )
        stepped = apply_step(model, alone, {name: step[k] for name, step in steps.items()})
        for kind, values in stepped.values.items():
            np.testing.assert_allclose(after.values[kind][k], values, rtol=1e-12, atol=1e-15)
        found = column_values(model, many)["hand_joint_offsets"][k]
        np.testing.assert_array_equal(found, column_values(model, alone)["hand_joint_offsets"])


def test_repeat_of_kinematics_has_all_estimated_values(arm, joints):
    """Repeated kinematics contain all estimated values, and values of missing types are zero."""
    model = robot_model("hand", arm, {"link_parameters": link_parameters.Stated(status="free")}, joints)
    spread = Kinematics(arm, {"joint_offsets": np.arange(6.0)}).repeat(model, 2)
    np.testing.assert_array_equal(spread.values["joint_offsets"], [np.arange(6.0)] * 2)
    np.testing.assert_array_equal(spread.values["link_parameters"], np.zeros((2, 7, 6)))


def test_batch_of_robots_equals_separate_solutions():
    """Three starts of offsets and links reach their optimum, each in its own number of steps, to 1e-6 sigmas."""
    made = simulate(replace(ARMS, samples=12, **OFFSETS, **LINKS, **NOISY), seed=3)
    problem, _ = build_problem(made.cell, made.recording)
    solution = solve(made.cell, made.recording)
    rng, dof = np.random.default_rng(0), solution.dof
    states = solution.state.repeat(problem, 3)
    normal = linearise(problem, states)
    starts = retract(problem, states, normal, 1e-3 * rng.standard_normal((3, problem.width)) * np.arange(3)[:, None])
    together = bundle_adjust_batch(problem, starts, dof)
    assert together.converged.all()
    for k in range(3):
        alone = bundle_adjust(problem, take(starts, k), dof)
        assert together.iterations[k] == alone.iterations
        for robot, kinematics in alone.state.robots.items():
            for kind, values in kinematics.values.items():
                np.testing.assert_allclose(together.state.robots[robot].values[kind][k], values, atol=1e-9)


@pytest.mark.parametrize("noise", [{}, NOISY])
@pytest.mark.parametrize("layout", ["dual", "eye_to_hand"])
def test_jacobian_by_robot_kinematics(layout, noise):
    """The Jacobian is correct along six directions that move every column.

    It includes the stop errors, which follow the modelled flange.
    """
    made = simulate(replace(ARMS, samples=4, layout=layout, **OFFSETS, **LINKS, **GIVING, **noise), seed=2)
    problem, _ = build_problem(made.cell, made.recording)
    errors = np.random.default_rng(0).standard_normal((len(problem.stops), 6))
    state = State(made.truth, made.cameras, errors, made.robots)
    normal = linearise(problem, state)
    (group,) = problem.groups
    links = chain(group, state, problem.stops)
    derivative, columns = robot_model_jacobian(problem, group, links, state, 6)
    assert len(columns) == 54 * len(made.robots)
    size = np.concatenate([np.ones(48), np.full(6, _PER_NEWTON_METRE)] * len(made.robots))
    ways = size[:, None] * np.linalg.qr(np.random.default_rng(1).standard_normal((len(columns), 6)))[0]

    def after(step):
        whole = np.zeros(problem.width)
        whole[columns] = ways @ step
        end = replace(retract(problem, state, normal, whole), stop_errors=errors)
        return (links.camera_from_target.inverse() @ end.camera_from_target(group, problem.stops)).log()

    check_derivative(after, derivative @ ways)


def test_fixed_kinematics_equal_recorded_poses():
    """Joints of a robot with fixed kinematics give the result of its poses."""
    made = simulate(ARMS, seed=1)
    chains = {name: robot.chain for name, robot in made.cell.robots.items()}
    posed = [
        replace(s, robots={r: RobotState(chains[r].forward(state.joints_rad)) for r, state in s.robots.items()})
        for s in made.recording.samples
    ]
    by_joints = solve(made.cell, made.recording)
    by_poses = solve(made.cell, replace(made.recording, samples=tuple(posed)))
    for name, estimate in by_joints.transforms.items():
        np.testing.assert_allclose(estimate.mean.matrix, by_poses.transforms[name].mean.matrix, atol=1e-12)


@pytest.mark.journey
@pytest.mark.parametrize("noise", [{}, pytest.param(NOISY, marks=pytest.mark.slow)])
def test_optimum_and_covariance_equal_the_dense_problem(noise):
    """The optimum agrees to 1e-3 and the covariance to 2 % of the sigmas of a dense solver.

    Unknowns are offsets, transforms and stops.
    """
    made = simulate(replace(ARMS, samples=6, **OFFSETS, **noise), seed=3)
    ours = solve(made.cell, made.recording)
    oracle = DenseProblem(made.cell, made.recording, ours.state.transforms, ours.state.stop_errors)
    transforms, covariance, cost = oracle.solve()
    assert ours.cost == pytest.approx(cost, rel=1e-6)
    sigma = np.sqrt(np.diag(covariance))
    for name, of in ours.state.transforms.items():
        off = (of.inverse() @ type(of).from_matrix(transforms[name])).log()
        assert np.all(np.abs(off) < 1e-3 * sigma[ours.problem.columns[name]])
    for robot, offsets in oracle.found_offsets.items():
        where = ours.problem.columns[f"{robot}_joint_offsets"]
        assert np.all(np.abs(ours.state.robots[robot].kind_values("joint_offsets") - offsets) < 1e-3 * sigma[where])
    np.testing.assert_allclose(ours.covariance / np.outer(sigma, sigma), covariance / np.outer(sigma, sigma), atol=0.02)


@pytest.mark.parametrize(
    "kind",
    [
        {"joint_offset_rad": 0.004, "joint_offsets": "free"},
        {**LINKS, "link_parameters": "free"},
        OFFSETS | LINKS,
        OFFSETS | GIVING,
    ],
)
def test_kinematics_are_observable_and_predict_new_views(kind):
    """With 40 samples no direction is unobservable. `camera_from_target` at ten other joints is right to 0.2 mm rms."""
    made = simulate(replace(ARMS, samples=50, target="charuco", **kind), 4)
    ours = solve(made.cell, replace(made.recording, samples=made.recording.samples[:40]))
    assert ours.converged
    assert ours.observability.null_space == ()
    others, _ = build_problem(made.cell, replace(made.recording, samples=made.recording.samples[40:]))
    (group,) = others.groups
    truth = State(made.truth, made.cameras, np.zeros((0, 6)), made.robots)
    wanted, found = (each.camera_from_target(group, others.stops) for each in (truth, ours.state))
    assert np.sqrt(np.mean(np.sum((wanted.inverse() @ found).translation ** 2, -1))) < 2e-4


def test_deflection_without_masses_is_refused():
    """The error about deflection without masses says in one sentence what the URDF lacks."""
    made = simulate(replace(ARMS, **GIVING), seed=0)
    bare = replace(made.cell.robots["hand"], chain=replace(made.cell.robots["hand"].chain, masses=None))
    with pytest.raises(InputError, match="'hand': deflection needs the masses"):
        solve(replace(made.cell, robots={**made.cell.robots, "hand": bare}), made.recording)


def test_mixed_recording_is_refused():
    """Offsets of a robot that one sample records by its pose are refused in one sentence with the robot's name."""
    made = simulate(replace(ARMS, **OFFSETS), seed=0)
    first = made.recording.samples[0]
    pose = RobotState(made.cell.robots["hand"].chain.forward(first.robots["hand"].joints_rad))
    mixed = replace(first, robots={**first.robots, "hand": pose})
    recording = replace(made.recording, samples=(mixed, *made.recording.samples[1:]))
    with pytest.raises(InputError, match=r"'hand'.*joints_rad in every sample"):
        solve(made.cell, recording)
