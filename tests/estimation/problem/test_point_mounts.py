"""Targets that are mere points, and points that were measured as poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import Cell, Recording
from basecal.cell.targets.points import points_target
from basecal.errors import InputError
from basecal.estimation.problem.build import build_problem
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate


def _of_a_point(status: str = "free") -> tuple[Cell, Recording]:
    """Poses measured of a target that is declared as one point."""
    made = simulate(Scenario(samples=12, target="pose", target_mount=status), seed=0)
    board = replace(made.cell.targets["board"], target=points_target([[0.0, 0.0, 0.0]]))
    return replace(made.cell, targets={"board": board}), made.recording


def test_orientation_of_a_point_that_was_measured_as_poses_counts():
    """Its mount has six columns, and the answer is that of a target of no kind."""
    cell, recording = _of_a_point()
    solution = solve(cell, recording)
    assert solution.problem.point_mounts == frozenset()
    plain = replace(cell, targets={"board": replace(cell.targets["board"], target=None)})
    for name, estimate in solve(plain, recording).transforms.items():
        np.testing.assert_allclose(solution.transforms[name].mean.matrix, estimate.mean.matrix, atol=1e-9)
        np.testing.assert_allclose(solution.transforms[name].covariance, estimate.covariance, rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize("status", ["fixed", "prior"])
def test_a_stated_mount_of_a_point_has_no_orientation_for_poses(status):
    """The error says what to leave out."""
    with pytest.raises(InputError, match="Leave out its `kind`"):
        build_problem(*_of_a_point(status))


@pytest.mark.parametrize(("target", "points"), [("led", {"hand_flange_from_board"}), ("points", set())])
def test_a_light_is_a_point(target, points):
    """The mount of a single light is a point; that of several points is none."""
    made = simulate(Scenario(samples=8, target=target), seed=0)
    assert build_problem(made.cell, made.recording)[0].point_mounts == points
