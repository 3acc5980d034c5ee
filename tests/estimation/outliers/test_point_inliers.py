"""Points that agree with the rest of their view, whatever state the view was predicted from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.outliers.point_inliers import points_within
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def problem_with_strays(scenario, seed=0, strays=6):
    """A problem whose views 1 and 3 have some points at random places, a state off by 5 mm and mrad, and the cell."""
    made = simulate(scenario, seed)
    problem, _ = build_problem(made.cell, made.recording)
    rng = np.random.default_rng(seed)
    (group,) = problem.groups
    wrong = np.zeros(group.measurement.seen.shape, dtype=bool)
    for view in (1, 3):
        wrong[view, rng.choice(wrong.shape[1], strays, replace=False)] = True
    name = "pixels" if hasattr(group.measurement, "pixels") else "points_in_camera"
    values = getattr(group.measurement, name).copy()
    size = 40.0 if name == "pixels" else 0.04
    values[wrong] += size * rng.choice([-1, 1], values[wrong].shape)
    moved = problem.with_groups([replace(group, measurement=replace(group.measurement, **{name: values}))])
    off = {n: t @ SE3.exp(5e-3 * rng.standard_normal(6)) for n, t in made.truth.items()}
    return moved, State(off, made.cameras, np.zeros((len(problem.stops), 6))), made.cell, wrong


def test_without_suspects_all_points_are_kept():
    """No view is searched."""
    problem, state, cell, _ = problem_with_strays(Scenario(samples=5))
    (kept,) = points_within(problem, state, [np.zeros(0, dtype=np.int64)], cell)
    assert kept.all()


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("target", ["charuco", "points3d"])
def test_strays_of_suspect_views_are_left_out(target, stated):
    """All of them, few others, and none of views that nobody suspects, whether their noise is stated or not."""
    scenario = Scenario(samples=5, target=target, state_pixel_noise=stated, state_observation_noise=stated)
    problem, state, cell, wrong = problem_with_strays(scenario, strays=6 if target == "charuco" else 2)
    (kept,) = points_within(problem, state, [np.array([1, 2])], cell)
    assert not kept[1, wrong[1]].any()
    assert kept[1, ~wrong[1]].mean() > 0.9
    assert kept[2].mean() > 0.9
    assert kept[[0, 3, 4]].all()


def test_points_not_seen_are_not_told():
    """They stay kept, as what is not there cannot be left out."""
    problem, state, cell, _ = problem_with_strays(Scenario(samples=5))
    (group,) = problem.groups
    seen = group.measurement.seen.copy()
    seen[1, :3] = False
    few = replace(group.measurement, seen=seen, weight=np.where(seen, group.measurement.weight, 0.0))
    (kept,) = points_within(problem.with_groups([replace(group, measurement=few)]), state, [np.array([1])], cell)
    assert kept[1, :3].all()


def test_a_lens_that_wrong_poses_have_bent_is_not_believed():
    """Of a free lens twice too short, strays are found by the lens that the views alone tell."""
    problem, state, cell, wrong = problem_with_strays(Scenario(samples=8, intrinsics="free"))
    lens = state.cameras["wrist"]
    bent = lens.with_parameters(lens.parameters * np.array([0.5, 0.7, *[1.0] * (len(lens.parameters) - 2)]))
    (kept,) = points_within(problem, replace(state, cameras={"wrist": bent}), [np.array([1, 3])], cell)
    assert not kept[wrong].any()
    assert kept[[1, 3]][~wrong[[1, 3]]].mean() > 0.8


def test_measured_poses_have_nothing_to_leave_out():
    """One entry a view, kept, though the view is suspect."""
    made = simulate(Scenario(samples=5, target="pose"), 0)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((0, 6)))
    (kept,) = points_within(problem, state, [np.array([1])], made.cell)
    assert kept.tolist() == [[True]] * 5
