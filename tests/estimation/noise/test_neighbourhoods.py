"""Tests of noise of many robots, estimated by the neighbourhood of views of each."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
from tests.ends import with_eye, with_hand
from tests.pose_problem import pose_problem, two_arm_problem

from basecal.estimation.noise import neighbourhoods as module
from basecal.estimation.noise.estimate import NoiseEstimate
from basecal.estimation.noise.neighbourhoods import (
    Neighbourhood,
    merge_estimates,
    neighbourhoods,
    uses_neighbourhoods,
)
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve_from
from basecal.estimation.stages import Stages
from basecal.estimation.view.measurement import Noise
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(layout="ring", robots=4, samples=96, robot_noise=(3e-4, 5e-4)), 2)
UNSTATED = replace(
    MADE.cell, robots={name: replace(robot, noise=None) for name, robot in MADE.cell.robots.items()}, pixel_px=None
)


class RecordingStages(Stages):
    """Stages that record only their parts."""

    def __init__(self, parts):
        self.parts = parts

    def stage(self, name):
        """A stage without a timer."""
        return nullcontext()

    def part(self, done, total):
        """Record a part."""
        self.parts.append((done, total))


@pytest.fixture(scope="module")
def problem():
    return build_problem(UNSTATED, MADE.recording)[0]


def state_of(problem):
    return State({n: MADE.truth[n] for n in problem.unknowns}, MADE.cameras, np.zeros((len(problem.stops), 6)))


def test_each_robot_has_its_own_views(problem):
    """The robot's base is fixed, transforms without its views have no column, and each camera belongs to one part."""
    parts = list(neighbourhoods(problem, state_of(problem)))
    assert [part.robot for part in parts] == sorted(MADE.cell.robots)
    assert sorted(name for part in parts for name in part.cameras) == sorted(MADE.cell.cameras)
    assert sorted(name for part in parts for name in part.targets) == sorted(MADE.cell.targets)
    for part in parts:
        assert all(part.robot in (group.eye.robot, group.hand.robot) for group in part.problem.groups)
        assert f"r1_base_from_{part.robot}_base" not in part.problem.columns
        used = np.concatenate([np.arange(s.start, s.stop) for s in part.problem.columns.values()])
        assert sorted(used) == list(range(part.problem.width))
        assert part.problem.width == 6 * len(part.problem.columns) == 6 * len(_needed_transforms(part))


def _needed_transforms(part):
    """Transforms that a robot's views depend on, except its base."""
    held = None if part.robot == "r1" else f"r1_base_from_{part.robot}_base"
    named = {n for g in part.problem.groups for n in (g.eye.mount, g.hand.mount, g.eye.base, g.hand.base)}
    return named - {held, None}


def test_few_unknowns_are_estimated_together(problem):
    """A ring of four robots has too few unknowns for neighbourhoods."""
    assert not uses_neighbourhoods(problem)


@pytest.mark.slow
def test_neighbourhood_sigmas_equal_the_joint_estimate(problem, monkeypatch):
    """Sigmas of robots (24 stops in two roles) and cameras are near the truth.

    The covariance is about that of the joint solution.
    """
    settings = Settings(robot_noise="estimated")
    whole = solve_from(problem, state_of(problem), settings)
    monkeypatch.setattr(module, "MANY_COLUMNS", 1)
    parts = []
    found = solve_from(problem, state_of(problem), replace(settings, stages=RecordingStages(parts)))
    assert parts == [(k, 4) for k in range(4)]
    assert found.converged
    for sigma in found.noise.robots.values():
        np.testing.assert_allclose(sigma, np.repeat([3e-4, 5e-4], 3), rtol=0.45)
    for noise in found.noise.cameras.values():
        assert noise.pixel_px == pytest.approx(0.2, rel=0.1)
    ratio = np.sqrt(np.diag(found.covariance) / np.diag(whole.covariance))
    assert 0.8 < ratio.min() < ratio.max() < 1.25


def test_single_robot_has_no_neighbourhoods(problem, monkeypatch):
    """A single robot has no neighbourhoods with any number of unknowns.

    Several robots have them once there are many unknowns.
    """
    alone = simulate(Scenario(layout="eye_in_hand", samples=6), 0)
    alone = build_problem(alone.cell, alone.recording)[0]
    monkeypatch.setattr(module, "MANY_COLUMNS", 2)
    assert uses_neighbourhoods(problem)
    assert not uses_neighbourhoods(alone)
    monkeypatch.setattr(module, "MANY_COLUMNS", problem.width + 1)
    assert not uses_neighbourhoods(problem)


def test_sigmas_are_merged_over_neighbourhoods():
    """Robots have the mean of their squares, and cameras and shapes those of their neighbourhood.

    Negative log evidences add up.
    """

    def estimate(pixel_px, settled, variances, minus_2_log_evidence, shapes):
        """The estimate of one neighbourhood with both cameras."""
        cameras = {"a": Noise(pixel_px), "b": Noise(2 * pixel_px)}
        return NoiseEstimate(
            Noise(pixel_px), 1.0, ("pixel_px",) if settled else (), settled, {}, cameras,
            minus_2_log_evidence=minus_2_log_evidence, plain_minus_2_log_evidence=10 * minus_2_log_evidence,
            shapes=shapes,
            robot_variances={robot: np.full(6, of) for robot, of in variances.items()},
        )  # fmt: skip

    shape = (np.ones(3), np.eye(3))
    found = {
        "r1": estimate(0.1, True, {"r1": 4e-6}, 3.0, {"t": shape, "u": (np.zeros(3), np.eye(3))}),
        "r2": estimate(0.3, False, {"r2": 9e-6}, 4.0, {"u": shape}),
    }
    parts = {
        "r1": Neighbourhood("r1", None, None, frozenset({"a"}), frozenset({"t"})),
        "r2": Neighbourhood("r2", None, None, frozenset({"b"}), frozenset({"u"})),
    }
    of = merge_estimates(found, parts)
    assert {name: noise.pixel_px for name, noise in of.cameras.items()} == {"a": 0.1, "b": 0.6}
    assert of.shapes == {"t": shape, "u": shape}
    np.testing.assert_allclose(of.robots["r1"], 2e-3)
    np.testing.assert_allclose(of.robots["r2"], 3e-3)
    assert (of.estimated, of.converged, of.minus_2_log_evidence, of.plain_minus_2_log_evidence) == (
        ("pixel_px",),
        False,
        7.0,
        70.0,
    )
    assert merge_estimates({**found, "r2": found["r1"]}, parts).converged
    assert of.factor == 1.0
    assert of.noise == of.cameras["a"]


def test_two_robots_form_two_neighbourhoods(monkeypatch):
    """A single robot, and robots with estimated kinematics, have no neighbourhoods."""
    monkeypatch.setattr(module, "MANY_COLUMNS", 6)
    problem, state = two_arm_problem(np.zeros((3, 6)), [0, 1, 2], [3, 4, 5])
    assert uses_neighbourhoods(problem)
    assert not uses_neighbourhoods(replace(problem, models={"eye": None}))
    assert not uses_neighbourhoods(pose_problem(np.zeros((3, 6)), None)[0])
    assert not uses_neighbourhoods(replace(problem, columns={}))
    of_eye, of_hand = neighbourhoods(problem, state)
    assert (of_eye.robot, of_eye.cameras, of_eye.targets) == ("eye", {"camera"}, set())
    assert (of_hand.robot, of_hand.cameras, of_hand.targets) == ("hand", set(), {"target"})


@pytest.mark.parametrize("role", ["eye", "hand"])
def test_world_fixed_devices_join_the_other_robot(role):
    """A camera on the world belongs to the target's arm, a target to the camera's. The arm's base has no column."""
    problem, state = two_arm_problem(np.zeros((3, 6)), [0, 1, 2], [3, 4, 5])
    (group,) = problem.groups
    moving, still = (with_eye, with_hand) if role == "eye" else (with_hand, with_eye)
    columns = {"base": slice(0, 6), "unused": slice(6, 12), group.eye.mount: slice(12, 18)}
    alone = replace(problem.with_groups([still(moving(group, base="base"), robot=None)]), columns=columns)
    (part,) = neighbourhoods(alone, state)
    assert (part.robot, part.cameras, part.targets) == (role, {"camera"}, {"target"})
    assert part.problem.columns == {group.eye.mount: slice(0, 6)}


def test_columns_are_compacted_in_order():
    """Columns are renumbered without gaps, and each keeps its width."""
    problem, _ = two_arm_problem(np.zeros((3, 6)), [0, 1, 2], [3, 4, 5])
    (group,) = problem.groups
    mount, target = group.eye.mount, group.hand.mount
    columns = {"other": slice(0, 4), target: slice(4, 7), "camera": slice(7, 16), mount: slice(16, 22)}
    found = module._columns(replace(problem, columns=columns), None)
    assert found == {target: slice(0, 3), "camera": slice(3, 12), mount: slice(12, 18)}
