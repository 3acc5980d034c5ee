"""Joint offsets and link errors: their gauges, their derivatives, and the same answer as a dense solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.derivatives import check_derivative
from tests.oracles.dense import DenseProblem

from basecal.cell import Deflection, Parameters, RobotState
from basecal.errors import InputError
from basecal.estimation.least_squares.jacobians import by_robot_models
from basecal.estimation.least_squares.normal_equations import linearise, retract
from basecal.estimation.problem.build import build_problem, free_ends
from basecal.estimation.problem.problem import State, chain
from basecal.estimation.problem.robot_parameters import Kinematics, by_columns, link_gauges, robot_model
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate
from basecal.simulation.arms import six_axis

ARMS = Scenario(samples=20, joints=True, target="points")
OFFSETS = {"joint_offset_rad": 0.004, "joint_offsets": "prior"}
LINKS = {"link_error": (5e-4, 1e-3), "link_parameters": "prior"}
GIVING = {"compliance": 1e-4, "deflection": "prior"}
_PER_NEWTON_METRE = 0.02  # so that a unit step turns joints by about a radian
NOISY = {"robot_noise": (2e-4, 3e-4)}


@pytest.fixture
def arm():
    return six_axis()


@pytest.fixture
def joints():
    return np.random.default_rng(0).uniform(-2, 2, (30, 6))


def test_shifts_and_turns_along_an_axis_pass_through_the_joint(arm, joints):
    """Without free ends the gauges, two a joint, move no flange at any joints."""
    gauges = link_gauges(arm, (False, False), with_offsets=False)
    assert np.linalg.matrix_rank(gauges) == 12
    np.testing.assert_allclose(arm.link_jacobian(joints) @ gauges, 0, atol=1e-12)


def test_what_a_free_base_and_mounts_take_up_is_no_link_error(arm, joints):
    """With free ends the 18 columns left and the two transforms span all that the 42 and the transforms do."""
    model = robot_model("hand", arm, Parameters(), Parameters("free"), (True, True))
    links = arm.link_jacobian(joints)
    poses = arm.forward(joints)
    ends = np.concatenate([poses.inverse().adjoint(), np.broadcast_to(np.eye(6), (30, 6, 6))], -1)
    kept = np.concatenate([links @ model.link_basis, ends], -1).reshape(180, -1)
    every = np.concatenate([links, ends], -1).reshape(180, -1)
    assert model.link_basis.shape == (42, 18)
    assert np.linalg.matrix_rank(kept) == 30 == np.linalg.matrix_rank(every)


def test_free_offsets_leave_out_what_the_ends_take_up(arm):
    """The first joint turns the arm as its free base does, the last as free mounts do; a prior keeps all."""
    free, prior = Parameters("free"), Parameters("prior", 0.01)
    ends = {(False, False): 6, (True, False): 5, (False, True): 5, (True, True): 4}
    for free_end, count in ends.items():
        assert len(robot_model("hand", arm, free, Parameters(), free_end).joints) == count
        assert len(robot_model("hand", arm, prior, Parameters(), free_end).joints) == 6
    assert robot_model("hand", arm, free, Parameters(), (True, True)).joints.tolist() == [1, 2, 3, 4]


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
def test_ends_are_free_where_all_that_could_hold_them_is(scenario, robot, ends):
    """A base, or for the reference everything else in the world; and all that a flange carries."""
    made = simulate(scenario, seed=0)
    assert free_ends(build_problem(made.cell, made.recording)[0], robot) == ends


def test_columns_are_derivatives_of_the_flange(arm, joints):
    """At offsets, link errors and compliances of some size, for all at once."""
    rng = np.random.default_rng(1)
    known = Parameters("prior", 0.01), Parameters("free"), (True, True), np.array([0, 2, 5])
    model = robot_model("hand", arm, *known, Deflection("free", down=(0.3, 0, -4)))
    at = Kinematics(arm, 0.1 * rng.standard_normal(6), 0.1 * rng.standard_normal((7, 6)), np.full(6, 1e-3), model.down)
    before = at.forward(joints).inverse()

    def after(step):
        offsets = at.offsets.copy()
        offsets[model.joints] += step[:3]
        links = at.links + (model.link_basis @ step[3:-6]).reshape(7, 6)
        compliance = at.compliance + _PER_NEWTON_METRE * step[-6:]
        return (before @ Kinematics(arm, offsets, links, compliance, at.down).forward(joints)).log()

    derivative = by_columns(model, at, joints)
    derivative[..., -6:] *= _PER_NEWTON_METRE
    check_derivative(after, derivative)


@pytest.mark.parametrize("noise", [{}, NOISY])
@pytest.mark.parametrize("layout", ["dual", "eye_to_hand"])
def test_views_move_with_the_kinematics_of_their_robots(layout, noise):
    """Along six ways that move every column, through the errors of stops too, which follow the modelled flange."""
    made = simulate(replace(ARMS, samples=4, layout=layout, **OFFSETS, **LINKS, **GIVING, **noise), seed=2)
    problem, _ = build_problem(made.cell, made.recording)
    errors = np.random.default_rng(0).standard_normal((len(problem.stops), 6))
    state = State(made.truth, made.cameras, errors, made.robots)
    normal = linearise(problem, state)
    (group,) = problem.groups
    links = chain(group, state, problem.stops)
    derivative, columns = by_robot_models(problem, group, links, state, 6)
    assert len(columns) == 54 * len(made.robots)
    size = np.concatenate([np.ones(48), np.full(6, _PER_NEWTON_METRE)] * len(made.robots))
    ways = size[:, None] * np.linalg.qr(np.random.default_rng(1).standard_normal((len(columns), 6)))[0]

    def after(step):
        whole = np.zeros(problem.width)
        whole[columns] = ways @ step
        end = replace(retract(problem, state, normal, whole), stop_errors=errors)
        return (links.camera_from_target.inverse() @ end.camera_from_target(group, problem.stops)).log()

    check_derivative(after, derivative @ ways)


def test_nothing_changes_for_robots_as_stated():
    """Joints of a robot that is fixed give what its poses give."""
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


@pytest.mark.parametrize("noise", [{}, pytest.param(NOISY, marks=pytest.mark.slow)])
def test_optimum_and_covariance_are_those_of_the_dense_problem(noise):
    """Offsets beside transforms and stops: optimum to 1e-3 and covariance to 2 % of the sigmas of a dense solver."""
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
        assert np.all(np.abs(ours.state.robots[robot].offsets - offsets) < 1e-3 * sigma[where])
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
def test_free_or_by_priors_everything_is_seen_and_unseen_views_are_predicted(kind):
    """With 40 samples no direction is unseen, and `camera_from_target` at ten other joints is right to 0.2 mm rms."""
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
    """One sentence that says what the URDF lacks."""
    made = simulate(replace(ARMS, **GIVING), seed=0)
    bare = replace(made.cell.robots["hand"], chain=replace(made.cell.robots["hand"].chain, masses=None))
    with pytest.raises(InputError, match="'hand': deflection needs the masses"):
        solve(replace(made.cell, robots={**made.cell.robots, "hand": bare}), made.recording)


def test_a_mixed_recording_is_refused():
    """Offsets of a robot that one sample records by its pose: one sentence with the robot's name."""
    made = simulate(replace(ARMS, **OFFSETS), seed=0)
    first = made.recording.samples[0]
    pose = RobotState(made.cell.robots["hand"].chain.forward(first.robots["hand"].joints_rad))
    mixed = replace(first, robots={**first.robots, "hand": pose})
    recording = replace(made.recording, samples=(mixed, *made.recording.samples[1:]))
    with pytest.raises(InputError, match=r"'hand'.*joints_rad in every sample"):
        solve(made.cell, recording)
