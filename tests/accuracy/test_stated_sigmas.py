"""Tests of stated sigmas compared with residuals, by camera and robot."""

from dataclasses import replace
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from scipy.stats import chi2, kstest, norm
from tests.pose_problem import pose_problem

from basecal.accuracy import stated_sigmas
from basecal.accuracy.stated_sigmas import (
    ContradictedSigma,
    _stop_squares,
    _view_squares,
    contradicted_sigmas,
    is_implausibly_small,
    judge_sigma,
    unlikely_sigmas,
    without_contradicted_sigmas,
)
from basecal.cell import Robot
from basecal.estimation.least_squares.studentized_residuals import leave_one_out
from basecal.estimation.outliers.robust_solve import RobustSolution
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_from, solve_problem
from basecal.simulation import Scenario, simulate

NOISE = (1e-3, 1e-3)
SETTINGS = Settings(robot_noise="stated")


def solve_cell(pixels=1.0, robots=1.0, seed=0, **changed):
    """A solution whose cell states these shares of its true sigmas."""
    made = simulate(Scenario(**{"samples": 20, "robot_noise": NOISE} | changed), seed)
    cell = made.cell
    stated = {name: Robot(name, None if r.noise is None else robots * r.noise) for name, r in cell.robots.items()}
    cell = replace(cell, pixel_px=pixels * 0.2, robots=stated)
    return solve_problem(build_problem(cell, made.recording)[0], cell, SETTINGS)


@pytest.mark.parametrize("arms", ["both", "stations"])
@pytest.mark.parametrize("share", [0.7, 0.9, 1.0, 1.2])
def test_wrong_pixel_sigma_is_contradicted(arms, share):
    """A wrong pixel sigma is contradicted by its ratio, and no robot's; true ones are not."""
    found = contradicted_sigmas(solve_cell(pixels=share, arms=arms))
    assert [f.about for f in found] == ([] if share == 1.0 else ["wrist"])
    if found:
        assert found[0].ratio == pytest.approx(1 / share, rel=0.06)
        assert found[0].is_too_small == (share < 1)


@pytest.mark.parametrize("arms", ["both", "stations"])
@pytest.mark.parametrize("share", [0.3, 3.0])
def test_wrong_robot_sigmas_are_contradicted(arms, share):
    """Wrong robot sigmas are contradicted by private and shared stop errors, not the camera's."""
    found = contradicted_sigmas(solve_cell(robots=share, arms=arms))
    assert found
    assert {f.about for f in found} <= {"eye", "hand"}
    assert all(f.of_robot and f.is_too_small == (share < 1) for f in found)


def test_estimated_sigmas_are_not_judged():
    """Estimated sigmas cannot be contradicted."""
    assert contradicted_sigmas(solve_cell(robot_noise=(0.0, 0.0), target="pose", state_observation_noise=False)) == ()


@pytest.mark.slow
def test_chances_are_uniform(monkeypatch):
    """Squares of pixels over their mean, with true sigmas, are normal about 1 with their freedoms."""
    monkeypatch.setattr("basecal.accuracy.stated_sigmas.SINGLE_LEVEL", 2.0)
    ratios = [f.ratio for k in range(60) for f in contradicted_sigmas(solve_cell(seed=k)) if f.about == "wrist"]
    freedoms = 20 * 2 * 24 - 18 - 20 * 6
    scores = (np.array(ratios) ** 2 - 1) * np.sqrt(freedoms / 2)
    assert kstest(scores, norm.cdf).pvalue > 1e-3


def test_contradicted_sigmas_are_estimated():
    """Contradicted sigmas are estimated: the covariance is that of the true ones.

    True and too large sigmas stay as stated.
    """
    true, small = solve_cell(), solve_cell(pixels=0.5)
    before = RobustSolution(small, (), small.problem.with_groups(()), 20, 0)
    after = without_contradicted_sigmas(before, contradicted_sigmas(small), SETTINGS).solution
    assert after.noise.noise.pixel_px == pytest.approx(0.2, rel=0.1)
    base = ["eye_base_from_hand_base"]
    ratio = np.diag(after.joint_transform_covariance(base)) / np.diag(true.joint_transform_covariance(base))
    assert np.all(np.abs(np.log(ratio)) < 0.5)
    large = solve_cell(pixels=2.0)
    before = RobustSolution(large, (), large.problem.with_groups(()), 20, 0)
    assert without_contradicted_sigmas(before, contradicted_sigmas(large), SETTINGS) is before


def test_failed_solution_is_not_judged():
    """Residuals of a failed or infinite solution do not contradict sigmas."""
    small = solve_cell(pixels=0.5)
    assert contradicted_sigmas(small)
    assert contradicted_sigmas(replace(small, converged=False)) == ()
    assert contradicted_sigmas(replace(small, cost=np.inf)) == ()
    assert contradicted_sigmas(replace(small, cost=np.nan)) == ()


@pytest.mark.parametrize("changed", [{}, {"arms": "stations"}, {"target": "points", "arms": "halves"}])
def test_freedoms_of_parts_sum_to_total(changed):
    """Freedoms, residuals less unknowns, and squares of all cameras and robots sum to those of the whole."""
    solution = solve_cell(**changed)
    problem = solution.noise.hold_sigmas(solution.problem)
    about = leave_one_out(problem, solution.state, [np.ones(len(g)) for g in problem.groups])
    parts = [*_view_squares(about), *_stop_squares(about)]
    assert {name for name, *_ in parts} == {"wrist", "eye", "hand"}
    assert sum(freedoms for *_, freedoms in parts) == pytest.approx(solution.dof, rel=1e-6)
    assert sum(squares for *_, squares, _ in parts) == pytest.approx(solution.cost, rel=1e-6)
    assert all(freedoms > 0 for *_, freedoms in parts)
    assert all(freedoms < 6 * 20 for name, _, _, freedoms in parts if name != "wrist")


@pytest.mark.parametrize(("times", "is_contradicted"), [(1.0, False), (2.0, True), (0.5, True)])
def test_poses_about_mean_follow_chi_square(times, is_contradicted):
    """Squares of twenty poses about an unknown mount follow chi-square with six freedoms less than numbers."""
    errors = times * np.random.default_rng(0).standard_normal((20, 6))
    problem, state = pose_problem(1e-3 * errors, np.full(6, 1e-3))
    found = contradicted_sigmas(solve_from(problem, state))
    squares, freedoms = np.sum((errors - errors.mean(0)) ** 2), 6 * 20 - 6
    assert [(f.about, f.of_robot) for f in found] == ([("camera", False)] if is_contradicted else [])
    for each in found:
        assert each.ratio == pytest.approx(np.sqrt(squares / freedoms), rel=1e-3)
        tail = chi2.sf if times > 1 else chi2.cdf
        assert np.log(each.chance) == pytest.approx(np.log(tail(squares, freedoms)), rel=1e-2)
        assert each.is_too_small == (times > 1)
    few, at = pose_problem(1e-3 * errors[:1], np.full(6, 1e-3))
    assert contradicted_sigmas(solve_from(few, at)) == ()


@pytest.mark.parametrize(
    ("squares", "freedoms", "is_contradicted"),
    [(100.0, 4.0, True), (100.0, 2.9, False), (0.01, 4.0, True), (5.0, 4.0, False), (4.0, 4.0, False)],
)
def test_sigma_is_judged_by_chi_square(squares, freedoms, is_contradicted):
    """A sigma is judged by chi-square on the side on which it is off, with at least three freedoms.

    Its ratio is the root of squares over freedoms.
    """
    found = judge_sigma("eye", True, squares, freedoms)
    assert (found is not None) == is_contradicted
    if is_contradicted:
        tail = chi2.sf if squares > freedoms else chi2.cdf
        assert (found.about, found.of_robot, found.is_too_small) == ("eye", True, squares > freedoms)
        assert found.chance == pytest.approx(tail(squares, freedoms))
        assert found.ratio == pytest.approx(np.sqrt(squares / freedoms))


def test_zero_squares_have_finite_ratio():
    """Zero squares have a tiny positive ratio, and a ratio of 1 is not too small."""
    assert 0 < judge_sigma("eye", True, 0.0, 40.0).ratio < 1e-100
    assert not ContradictedSigma("eye", True, 1.0, 0.5).is_too_small


class Views(NamedTuple):
    """A group of two views."""

    camera: str
    measurement: SimpleNamespace


def find_contradicted(monkeypatch, views, stops=(), unstated=(), counts=(), squares=(100.0, 100.0)):
    """Contradictions of these parts of the residuals; `counts` are pairs of a camera and the source of its sigmas."""
    monkeypatch.setattr(stated_sigmas, "leave_one_out", lambda *given: None)
    monkeypatch.setattr(stated_sigmas, "_view_squares", lambda about: iter(views))
    monkeypatch.setattr(stated_sigmas, "_stop_squares", lambda about: iter(stops))
    groups = [Views(camera, SimpleNamespace(counts=lambda of=of: of)) for camera, of in counts]
    problem = SimpleNamespace(groups=groups, unstated=frozenset(unstated))
    noise = SimpleNamespace(hold_sigmas=lambda problem: problem)
    cost, dof = squares
    solution = SimpleNamespace(converged=True, cost=cost, dof=dof, problem=problem, noise=noise, state=None)
    return [(f.about, f.of_robot, round(f.ratio, 6)) for f in contradicted_sigmas(solution)]


def test_parts_of_device_are_judged_together(monkeypatch):
    """Squares and freedoms of views and shared stops of one device add up; the worst contradiction comes first."""
    views = [("a", False, 100.0, 20.0), ("b", False, 5.0, 100.0), ("a", False, 80.0, 25.0), ("r", True, 30.0, 10.0)]
    stops = [("r", True, 60.0, 20.0), ("s", True, 21.0, 20.0)]
    found = find_contradicted(monkeypatch, views, stops)
    assert found == [
        ("b", False, round(np.sqrt(0.05), 6)), ("a", False, 2.0), ("r", True, round(np.sqrt(3), 6)),
    ]  # fmt: skip


def test_only_stated_sigmas_are_judged(monkeypatch):
    """Robots without stated noise, and cameras with partly unstated sigmas, are not judged.

    A camera may have the name of a robot.
    """
    parts = [
        ("a", False, 400.0, 100.0),
        ("b", False, 400.0, 100.0),
        ("a", True, 400.0, 100.0),
        ("c", True, 400.0, 100.0),
    ]
    counts = [("a", {"stated": 4, "pixel_px": 0}), ("b", {"stated": 4, "pixel_px": 2})]
    found = find_contradicted(monkeypatch, parts, unstated={"a"}, counts=counts)
    assert sorted(found) == [("a", False, 2.0), ("c", True, 2.0)]


@pytest.mark.parametrize(
    ("parts", "unstated", "expected"),
    [
        (2, (), [("", False, 2.0)]),
        (1, (), []),
        (2, ("r1",), []),
    ],
)
def test_sigmas_are_judged_together_if_none_alone_is_contradicted(monkeypatch, parts, unstated, expected):
    """All sigmas are judged together if none alone is contradicted, there are several, and all are stated."""
    views = [(f"r{k}", True, 110.0, 100.0) for k in range(parts)]
    assert find_contradicted(monkeypatch, views, unstated=unstated, squares=(400.0, 100.0)) == expected
    views.append(("b", True, 900.0, 100.0))
    assert find_contradicted(monkeypatch, views, unstated=unstated, squares=(400.0, 100.0)) == [("b", True, 3.0)]


def test_relative_point_sigmas_are_kept():
    """Point sigmas relative to the median are kept and none stays stated; points without one count as the median."""
    (group,) = build_problem(*make_cell(target="charuco"))[0].groups
    seen = group.measurement
    stated = np.zeros_like(seen.stated)
    stated[0, :3] = 0.5, 4.0, 8.0
    found = replace(seen, stated=stated).without_sigmas()
    expected = np.ones_like(stated)
    expected[0, :3] = 0.125, 1.0, 2.0
    np.testing.assert_array_equal(found.relative, expected)
    assert not found.stated.any()
    np.testing.assert_array_equal(replace(seen, stated=0 * stated).without_sigmas().relative, 1.0)


def make_cell(**changed):
    """A small cell and its recording."""
    made = simulate(Scenario(samples=3, **changed), 0)
    return made.cell, made.recording


@pytest.mark.parametrize("target", ["pose", "points3d"])
def test_unstating_poses_and_points_keeps_weights(target):
    """Without sigmas, poses and points in space state none, and all else stays."""
    (group,) = build_problem(*make_cell(target=target))[0].groups
    assert group.measurement.stated.any()
    found = group.measurement.without_sigmas()
    assert not found.stated.any()
    assert found.weight is group.measurement.weight


def solve_opened_problem(monkeypatch, found, robot_noise):
    """The problem solved instead of one with contradicted sigmas, and how it is solved."""
    solved_with = []
    problem = build_problem(*make_cell(robot_noise=NOISE))[0]
    (group,) = problem.groups
    other = replace(group, camera="other")
    problem = replace(problem.with_groups([group, other]), held=True, unstated=frozenset({"third"}))
    solution = solve_stub(problem)
    monkeypatch.setattr(
        stated_sigmas, "solve_from", lambda problem, *_: solved_with.append(("from", problem)) or solve_stub(problem)
    )
    monkeypatch.setattr(
        stated_sigmas, "with_noise", lambda of, _: solved_with.append(("noise", of.problem)) or solve_stub(of.problem)
    )
    monkeypatch.setattr(stated_sigmas, "integrate_solution", lambda solution: replace(solution, cost=7.0))
    robust = RobustSolution(solution, (), problem.with_groups([group]), 3, 0)
    after = without_contradicted_sigmas(robust, found, Settings(robot_noise=robot_noise))
    for stops in (after.left_out.groups[0].eye.stop, after.left_out.groups[0].hand.stop):
        np.testing.assert_array_equal(stops, -1)
        assert len(stops) == 3
    assert after.solution.cost == (7.0 if robot_noise != "stated" else 1.0)
    (how, now) = solved_with[0]
    assert len(solved_with) == 1
    assert not now.held
    return how, {g.camera for g in now.groups if not g.measurement.stated.any()}, set(now.unstated)


def solve_stub(problem):
    """A solution with only a problem."""
    return Solution(problem, None, None, None, None, 1.0, 0, True, ())


def too_small(about, of_robot):
    return ContradictedSigma(about, of_robot, 2.0, 0.0)


@pytest.mark.parametrize(
    ("found", "cameras", "robots"),
    [
        ([too_small("wrist", False)], {"wrist"}, set()),
        ([too_small("eye", True)], set(), {"eye"}),
        ([too_small("hand", True), too_small("other", False)], {"other"}, {"hand"}),
        ([too_small("eye", False)], set(), set()),
        ([too_small("", False)], {"wrist", "other"}, {"eye", "hand"}),
        ([too_small("eye", True), ContradictedSigma("wrist", False, 0.5, 0.0)], set(), {"eye"}),
    ],
)
def test_only_too_small_sigmas_are_estimated(monkeypatch, found, cameras, robots):
    """Only the named camera's or robot's too small sigmas are estimated, or all if all together are too small.

    A camera may have the name of a robot.
    """
    assert solve_opened_problem(monkeypatch, found, "estimated") == ("noise", cameras, robots | {"third"})


def test_stated_robot_noise_is_not_estimated(monkeypatch):
    """If robot noise is taken as stated, only camera sigmas are estimated."""
    found = [too_small("eye", True), too_small("wrist", False)]
    assert solve_opened_problem(monkeypatch, found, "stated") == ("from", {"wrist"}, {"third"})


def test_implausibly_small_noise_is_refuted_by_evidence():
    """Robot noise of 0.1 um is refuted by evidence, though views of unstated noise absorb the errors.

    True sigmas stay.
    """
    for factor, robots in ((1e-3, ["eye", "hand"]), (1.0, [])):
        made = simulate(Scenario(samples=16, robot_noise=(1e-4, 2e-4), state_pixel_noise=False), 0)
        stated = {n: Robot(n, None if r.noise is None else factor * r.noise) for n, r in made.cell.robots.items()}
        cell = replace(made.cell, robots=stated)
        plain = solve_problem(build_problem(cell, made.recording)[0], cell, Settings(robot_noise="estimated"))
        found = unlikely_sigmas(plain, Settings())
        assert [each.about for each in found] == robots
        assert not found or np.sqrt(np.mean([each.ratio**2 for each in found])) == pytest.approx(1e3, rel=0.5)


@pytest.mark.parametrize(
    ("small", "large", "hidden", "left", "asked", "taken"),
    [
        (0, 0, "ab", "", 0, False),
        (2, 0, "", "", 2, True),
        (1, 2, "ab", "ab", 1, True),
        (0, 2, "", "", 0, False),
        (0, 2, "ab", "a", 2, True),
        (0, 2, "ab", "", 2, True),
        (0, 2, "ab", "ab", 2, False),
        (0, 2, "ab", "c", 2, False),
    ],
)
def test_sigmas_are_estimated_if_too_small_or_hiding(monkeypatch, small, large, hidden, left, asked, taken):
    """Too small sigmas alone are estimated; too large ones if fewer transforms are then unobservable."""
    given = []

    def robust(names):
        return SimpleNamespace(solution=SimpleNamespace(observability=SimpleNamespace(unobservable=frozenset(names))))

    before, after = robust(hidden), robust(left)
    monkeypatch.setattr(
        stated_sigmas, "_estimate_sigmas", lambda robust, found, settings: given.append(len(found)) or after
    )
    contradictions = [SimpleNamespace(is_too_small=True)] * small + [SimpleNamespace(is_too_small=False)] * large
    found = without_contradicted_sigmas(before, contradictions, Settings())
    assert found is (after if taken else before)
    assert given == ([asked] if asked else [])


@pytest.mark.parametrize(("turn", "is_below"), [(1e-7, True), (1e-5, True), (1e-4, False), (1e-3, False)])
def test_rotations_below_arcseconds_are_implausible(turn, is_below):
    """Mean rotation noise of a few arcseconds is implausibly small for an arm; translations have no effect."""
    assert is_implausibly_small(np.array([1e-9, 1e-9, 1e-9, 0.5 * turn, turn, 1.5 * turn])) is is_below
    assert is_implausibly_small(np.array([1.0, 1.0, 1.0, 0.5 * turn, turn, 1.5 * turn])) is is_below
