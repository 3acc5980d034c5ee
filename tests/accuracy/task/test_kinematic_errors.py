"""How flanges move with errors of their arms' joints and links, against arms that have them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.task.kinematic_errors import MODELS, kinematic_errors, moved_by_errors
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.simulation import Scenario, simulate

STEP = 1e-6
JOINTS = Scenario(samples=6, joints=True)


def problem_and_state(scenario: Scenario):
    made = simulate(scenario, 2)
    problem, _ = build_problem(made.cell, made.recording)
    return made, problem, State(made.truth, made.cameras, np.zeros((0, 6)))


def shifted(chain, error: int) -> Kinematics:
    """An arm of one error: offsets first, then links."""
    values = np.zeros(chain.n + 6 * (chain.n + 1))
    values[error] = STEP
    return Kinematics(chain, {"joint_offsets": values[: chain.n], "link_parameters": values[chain.n :].reshape(-1, 6)})


def test_errors_move_stops_and_points_as_they_move_the_arm():
    """Each column is the derivative to its error, of the flange at its stops and, in base axes, sent there."""
    made, problem, state = problem_and_state(JOINTS)
    joints = np.array([sample.robots["hand"].joints_rad for sample in made.recording.samples])
    chain = problem.chains["hand"]
    found = kinematic_errors(problem, state, "hand")
    before = chain.forward(joints)
    at_points = moved_by_errors(problem, state, "hand", before.translation)
    assert found.by_stop.shape == (6, 6, len(found.is_turn))
    for error in range(0, len(found.is_turn), 5):
        after = shifted(chain, error).forward(joints)
        right = (before.inverse() @ after).log() / STEP
        np.testing.assert_allclose(right, found.by_stop[..., error], atol=1e-5)
        np.testing.assert_allclose((after.translation - before.translation) / STEP, at_points[:, :3, error], atol=1e-5)
        np.testing.assert_allclose((after @ before.inverse()).rotvec / STEP, at_points[:, 3:, error], atol=1e-5)


def test_turns_are_offsets_and_turns_of_links():
    """Six offsets, then of each link three shifts and three turns."""
    _, problem, state = problem_and_state(JOINTS)
    found = kinematic_errors(problem, state, "eye")
    np.testing.assert_array_equal(found.is_turn, [True] * 6 + 7 * [False, False, False, True, True, True])


def test_models_are_parts_of_all_errors():
    """Offsets alone are the first six columns, links alone the others, at stops and at points."""
    made, problem, state = problem_and_state(JOINTS)
    places = made.true_base_from_flange["hand"].translation
    every, at_points = kinematic_errors(problem, state, "hand"), moved_by_errors(problem, state, "hand", places)
    for kinds, part in zip(MODELS, (slice(0, 6), slice(6, 48), slice(0, 48)), strict=True):
        found = kinematic_errors(problem, state, "hand", kinds)
        np.testing.assert_array_equal(found.by_stop, every.by_stop[..., part])
        np.testing.assert_array_equal(found.is_turn, every.is_turn[part])
        moved = moved_by_errors(problem, state, "hand", places, kinds)
        np.testing.assert_array_equal(moved, at_points[..., part])


@pytest.mark.parametrize(
    ("stated", "count"), [({}, 48), ({"joint_offsets": "prior"}, 42), ({"joint_offsets": "free"}, 48)]
)
def test_what_has_a_prior_is_not_open(stated, count):
    """Kinds whose sigmas are stated are estimated by these; a free kind is held by errors where nothing shows it."""
    _, problem, state = problem_and_state(replace(JOINTS, joint_offset_rad=1e-3, **stated))
    assert len(kinematic_errors(problem, state, "hand").is_turn) == count


def test_robots_by_poses_have_none():
    """Without a chain, or with all kinds under priors."""
    _, problem, state = problem_and_state(Scenario(samples=6))
    assert kinematic_errors(problem, state, "hand") is None
    stated = {"joint_offsets": "prior", "link_parameters": "prior"}
    _, problem, state = problem_and_state(replace(JOINTS, joint_offset_rad=1e-3, link_error=(1e-4, 2e-4), **stated))
    assert kinematic_errors(problem, state, "hand") is None
