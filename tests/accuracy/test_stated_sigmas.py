"""Stated sigmas against residuals, by camera and robot."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, kstest, norm
from tests.pose_problem import pose_problem

from basecal.accuracy.stated_sigmas import (
    _of_shared_stops,
    _of_views,
    contradicted_sigmas,
    without_contradicted,
)
from basecal.cell import Robot
from basecal.estimation.least_squares.studentized import leave_one_out
from basecal.estimation.outliers.robust_solve import RobustSolution
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve_from, solve_packed
from basecal.simulation import Scenario, simulate

NOISE = (1e-3, 1e-3)
SETTINGS = Settings(robot_noise="stated")


def solved(pixels=1.0, robots=1.0, seed=0, **changed):
    """A cell that states so much of its true sigmas."""
    made = simulate(Scenario(**{"samples": 20, "robot_noise": NOISE} | changed), seed)
    cell = made.cell
    stated = {name: Robot(name, None if r.noise is None else robots * r.noise) for name, r in cell.robots.items()}
    cell = replace(cell, pixel_px=pixels * 0.2, robots=stated)
    return solve_packed(build_problem(cell, made.recording)[0], cell, SETTINGS)


@pytest.mark.parametrize("arms", ["both", "stations"])
@pytest.mark.parametrize("share", [0.7, 0.9, 1.0, 1.2])
def test_pixels(arms, share):
    """The camera's sigma is contradicted, by as much as it is off, and no robot's; true ones are not."""
    found = contradicted_sigmas(solved(pixels=share, arms=arms))
    assert [f.about for f in found] == ([] if share == 1.0 else ["wrist"])
    if found:
        assert found[0].ratio == pytest.approx(1 / share, rel=0.06)
        assert found[0].too_small == (share < 1)


@pytest.mark.parametrize("arms", ["both", "stations"])
@pytest.mark.parametrize("share", [0.3, 3.0])
def test_robots(arms, share):
    """Robots' sigmas are contradicted by what their stops' errors are, private and shared, not the camera's."""
    found = contradicted_sigmas(solved(robots=share, arms=arms))
    assert found
    assert {f.about for f in found} <= {"eye", "hand"}
    assert all(f.of_robot and f.too_small == (share < 1) for f in found)


def test_what_nobody_stated_is_not_judged():
    """Estimated sigmas are none that could be contradicted."""
    assert contradicted_sigmas(solved(robot_noise=(0.0, 0.0), target="pose", state_observation_noise=False)) == ()


@pytest.mark.slow
def test_chances_are_uniform(monkeypatch):
    """Of true sigmas the squares of pixels over their mean are normal about 1 as their freedoms say."""
    monkeypatch.setattr("basecal.accuracy.stated_sigmas.SIGNIFICANCE", 2.0)
    ratios = [f.ratio for k in range(60) for f in contradicted_sigmas(solved(seed=k)) if f.about == "wrist"]
    freedoms = 20 * 2 * 24 - 18 - 20 * 6
    scores = (np.array(ratios) ** 2 - 1) * np.sqrt(freedoms / 2)
    assert kstest(scores, norm.cdf).pvalue > 1e-3


def test_contradicted_sigmas_are_estimated():
    """The covariance is that of the true sigmas, and sigmas that are true, or too large, stay as stated."""
    true, small = solved(), solved(pixels=0.5)
    before = RobustSolution(small, (), small.problem.with_groups(()), 20, 0)
    after = without_contradicted(before, contradicted_sigmas(small), SETTINGS).solution
    assert after.noise.noise.pixel_px == pytest.approx(0.2, rel=0.1)
    base = ["eye_base_from_hand_base"]
    ratio = np.diag(after.covariance_of(base)) / np.diag(true.covariance_of(base))
    assert np.all(np.abs(np.log(ratio)) < 0.5)
    large = solved(pixels=2.0)
    before = RobustSolution(large, (), large.problem.with_groups(()), 20, 0)
    assert without_contradicted(before, contradicted_sigmas(large), SETTINGS) is before


def test_where_nothing_was_solved_nothing_is_judged():
    """Residuals of a descent that did not end, or has no cost, say nothing of sigmas."""
    small = solved(pixels=0.5)
    assert contradicted_sigmas(small)
    assert contradicted_sigmas(replace(small, converged=False)) == ()
    assert contradicted_sigmas(replace(small, cost=np.inf)) == ()
    assert contradicted_sigmas(replace(small, cost=np.nan)) == ()


@pytest.mark.parametrize("changed", [{}, {"arms": "stations"}, {"target": "points", "arms": "halves"}])
def test_freedoms_of_all_parts_are_those_of_the_whole(changed):
    """Residuals less unknowns, shared out between what each camera saw and where each robot stood; squares alike."""
    solution = solved(**changed)
    problem = solution.noise.held_by(solution.problem)
    about = leave_one_out(problem, solution.state, [np.ones(len(g)) for g in problem.groups])
    parts = [*_of_views(about), *_of_shared_stops(about)]
    assert {name for name, *_ in parts} == {"wrist", "eye", "hand"}
    assert sum(freedoms for *_, freedoms in parts) == pytest.approx(solution.dof, rel=1e-6)
    assert sum(squares for *_, squares, _ in parts) == pytest.approx(solution.cost, rel=1e-6)
    assert all(freedoms > 0 for *_, freedoms in parts)
    assert all(freedoms < 6 * 20 for name, _, _, freedoms in parts if name != "wrist")


@pytest.mark.parametrize(("times", "told"), [(1.0, False), (2.0, True), (0.5, True)])
def test_poses_about_their_mean_are_a_chi_square(times, told):
    """Of twenty poses of one unknown mount: the squares about their mean, and six freedoms less than numbers."""
    errors = times * np.random.default_rng(0).standard_normal((20, 6))
    problem, state = pose_problem(1e-3 * errors, np.full(6, 1e-3))
    found = contradicted_sigmas(solve_from(problem, state, Settings()))
    squares, freedoms = np.sum((errors - errors.mean(0)) ** 2), 6 * 20 - 6
    assert [(f.about, f.of_robot) for f in found] == ([("camera", False)] if told else [])
    for each in found:
        assert each.ratio == pytest.approx(np.sqrt(squares / freedoms), rel=1e-3)
        tail = chi2.sf if times > 1 else chi2.cdf
        assert np.log(each.chance) == pytest.approx(np.log(tail(squares, freedoms)), rel=1e-2)
        assert each.too_small == (times > 1)
    few, at = pose_problem(1e-3 * errors[:1], np.full(6, 1e-3))
    assert contradicted_sigmas(solve_from(few, at, Settings())) == ()
