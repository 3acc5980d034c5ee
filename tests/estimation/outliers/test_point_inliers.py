"""Tests of points that agree with the rest of their view, whatever state predicted the view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2
from tests.pose_problem import pose_problem

from basecal.estimation.least_squares.studentized_residuals import MahalanobisSquared
from basecal.estimation.outliers import point_inliers as module
from basecal.estimation.outliers.inlier_mask import InlierMask, all_inliers
from basecal.estimation.outliers.point_inliers import agreeing_points, readmit_points
from basecal.estimation.outliers.robust_scale import Scale
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
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


def test_all_points_are_kept_without_suspects():
    """Without suspect views no view is searched, and all points are kept."""
    problem, state, cell, _ = problem_with_strays(Scenario(samples=5))
    (kept,) = agreeing_points(problem, state, [np.zeros(0, dtype=np.int64)], cell)
    assert kept.all()


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("target", ["charuco", "points3d"])
def test_stray_points_of_suspect_views_are_excluded(target, stated):
    """All stray points, few others, and none of the other views are excluded, with stated or unstated noise."""
    scenario = Scenario(samples=5, target=target, state_pixel_noise=stated, state_observation_noise=stated)
    problem, state, cell, wrong = problem_with_strays(scenario, strays=6 if target == "charuco" else 2)
    (kept,) = agreeing_points(problem, state, [np.array([1, 2])], cell)
    assert not kept[1, wrong[1]].any()
    assert kept[1, ~wrong[1]].mean() > 0.9
    assert kept[2].mean() > 0.9
    assert kept[[0, 3, 4]].all()


def test_fitting_points_are_readmitted():
    """Points excluded by an earlier state return, whether their view is used or not, and stray points stay out."""
    problem, state, _, wrong = problem_with_strays(Scenario(samples=5), strays=2)
    lost = wrong.copy()
    lost[[1, 2], :3] = True
    used = np.array([True, True, False, True, True])
    found = readmit_points(problem, state, InlierMask((used,), (~lost,)), Scale(1.0, np.inf, np.inf, 1e-6))
    np.testing.assert_array_equal(found.points[0], ~wrong)
    np.testing.assert_array_equal(found.views[0], used)


def test_points_of_a_view_without_pose_stay_excluded():
    """A view with few remaining points does not predict the others, and a view of a pose has no points."""
    problem, state, _, wrong = problem_with_strays(Scenario(samples=5), strays=2)
    lost = np.zeros_like(wrong)
    lost[0, 2:] = True
    inliers = InlierMask((np.ones(5, dtype=bool),), (~lost,))
    assert readmit_points(problem, state, inliers, Scale(1.0, np.inf, np.inf, 1e-6)).same_as(inliers)
    posed, at = pose_problem(np.zeros((3, 6)), np.ones(6))
    every = all_inliers(posed)
    assert readmit_points(posed, at, every, Scale(1.0, np.inf, np.inf, 1e-6)).same_as(every)


def test_unseen_points_are_not_reported():
    """Unseen points stay marked as kept, because a missing point cannot be excluded."""
    problem, state, cell, _ = problem_with_strays(Scenario(samples=5))
    (group,) = problem.groups
    seen = group.measurement.seen.copy()
    seen[1, :3] = False
    few = replace(group.measurement, seen=seen, weight=np.where(seen, group.measurement.weight, 0.0))
    (kept,) = agreeing_points(problem.with_groups([replace(group, measurement=few)]), state, [np.array([1])], cell)
    assert kept[1, :3].all()


def test_biased_lens_is_not_used():
    """With a free lens at half the focal length, stray points are found by the lens estimated from the views alone."""
    problem, state, cell, wrong = problem_with_strays(Scenario(samples=8, intrinsics="free"))
    lens = state.cameras["wrist"]
    bent = lens.with_parameters(lens.parameters * np.array([0.5, 0.7, *[1.0] * (len(lens.parameters) - 2)]))
    (kept,) = agreeing_points(problem, replace(state, cameras={"wrist": bent}), [np.array([1, 3])], cell)
    assert not kept[wrong].any()
    assert kept[[1, 3]][~wrong[[1, 3]]].mean() > 0.8


def test_measured_poses_have_no_points_to_exclude():
    """Each view has one entry, which is kept though the view is suspect."""
    made = simulate(Scenario(samples=5, target="pose"), 0)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((0, 6)))
    (kept,) = agreeing_points(problem, state, [np.array([1])], made.cell)
    assert kept.tolist() == [[True]] * 5


def points_in_space(seen):
    """A group of views of points measured in space, of weight 2, with a visibility mask."""
    seen = np.array(seen, dtype=bool)
    problem, state = pose_problem(np.zeros((len(seen), 6)), None)
    points = np.random.default_rng(0).standard_normal((seen.shape[1], 3))
    weight = np.where(seen, 2.0, 0.0)
    measurement = PointMeasurement(points, np.tile(points, (len(seen), 1, 1)), seen, weight, weight)
    group = replace(problem.groups[0], measurement=measurement)
    return problem.with_groups([group]), state, group


def test_views_with_many_disagreeing_points_are_unclear():
    """The limit is a twentieth of the seen points. Views of eight points are always unclear, poses never."""
    seen = np.ones((5, 40), dtype=bool)
    seen[3, 20:], seen[4] = False, False
    _, _, group = points_in_space(seen)
    kept = np.ones((5, 40), dtype=bool)
    kept[0, :3] = kept[1, :2] = kept[3, :2] = kept[3, 25:] = False
    assert module._unclear(group, kept, np.arange(5)).tolist() == [0, 3, 4]
    assert module._unclear(group, kept, np.array([1, 2, 3])).tolist() == [3]
    for count, unclear in ((8, [0, 1]), (9, [])):
        _, _, few = points_in_space(np.ones((2, count)))
        assert module._unclear(few, np.ones((2, count), dtype=bool), np.arange(2)).tolist() == unclear
    poses = pose_problem(np.zeros((2, 6)), None)[0].groups[0]
    assert module._unclear(poses, np.ones((2, 1), dtype=bool), np.arange(2)).tolist() == []


@pytest.mark.parametrize(
    ("variances", "rounds"),
    [([1.4], 1), ([0.7], 1), ([1.6, 1.7], 2), ([0.6, 0.5], 2), ([4.0, 1.0, 4.0, 1.0], 4), ([10.0, 14.0], 2)],
)
def test_scale_and_points_are_iterated_until_stable(monkeypatch, variances, rounds):
    """The variance is iterated until it changes by less than a factor of 1.5, for at most four rounds.

    It starts at the stated scale, or at three pixels if it is unstated.
    """
    problem, state, group = points_in_space(np.ones((2, 5)))
    used, left = [], list(variances)

    def agreeing(group, poses, state, scale):
        """Accept all points."""
        used.append(scale)
        return np.ones((2, 5), dtype=bool), MahalanobisSquared(np.zeros(3), np.full(3, 3))

    monkeypatch.setattr(module, "_agreeing_points", agreeing)
    monkeypatch.setattr(module, "robust_scale", lambda *of: Scale(left.pop(0), 7.0, 1.0, of[3]))
    scale, _ = module._choose_points(problem, state, [[]])
    assert [of.variance for of in used] == [1.0, *variances[: rounds - 1]]
    assert scale.variance == variances[rounds - 1]
    assert (used[0].freedoms, used[0].chance) == (np.inf, 1e-6)
    silent = replace(group.measurement, stated=np.zeros((2, 5)))
    pixels = PixelMeasurement(silent.points_in_target, np.zeros((2, 5, 2)), silent.seen, silent.stated, silent.weight)
    for measurement, first in ((silent, 9.0), (pixels, 4.0 * 9.0)):
        used.clear()
        left[:] = [first]
        module._choose_points(problem.with_groups([replace(group, measurement=measurement)]), state, [[]])
        assert [of.variance for of in used] == [first]


def test_scale_uses_all_points_and_keeps_those_within(rng):
    """Each point has as many freedoms as coordinates. Unseen points are kept, and so are views without a hypothesis."""
    seen = np.ones((3, 6))
    seen[1, 5] = False
    _, state, group = points_in_space(seen)
    at = group.measurement.points_in_camera.copy()
    scale = Scale(1.0, np.inf, np.inf, 1e-6)
    limit = chi2.isf(1e-6, 3)
    at[1, 2, 0] += 1.01 * np.sqrt(limit) / 2.0 * 4
    group = replace(group, measurement=replace(group.measurement, points_in_camera=at))
    poses = [module._Hypotheses(np.array([1, 2]), SE3.identity((1, 2)))]
    kept, squares = module._agreeing_points(group, poses, state, scale)
    assert np.argwhere(~kept).tolist() == [[1, 2]]
    assert (len(squares.value), set(squares.freedoms.tolist())) == (11, {3})
    assert squares.value.max() == pytest.approx((4 * 1.01) ** 2 * limit)
    nothing, none = module._agreeing_points(group, [], state, scale)
    assert nothing.all()
    assert len(none.value) == 0
    poses = pose_problem(np.zeros((2, 6)), None)[0].groups[0]
    kept, squares = module._agreeing_points(poses, [], state, scale)
    assert kept.tolist() == [[True], [True]]
    assert (squares.value.shape, squares.freedoms.shape) == ((0,), (0,))


@pytest.mark.parametrize(("stated", "limit"), [(True, 1.5**2), (False, 1.0)])
@pytest.mark.parametrize("is_free", [True, False])
def test_lens_is_suspected_if_points_scatter(monkeypatch, stated, limit, is_free):
    """The limit is 1.5 sigmas, or a pixel if unstated. Of two lenses the one with less scatter is used."""
    made = simulate(Scenario(samples=3, intrinsics="free" if is_free else "fixed", state_pixel_noise=stated), 0)
    problem, _ = build_problem(made.cell, made.recording)
    bent = {name: replace(of) for name, of in made.cameras.items()}
    state = State(made.truth, bent, np.zeros((0, 6)))
    monkeypatch.setattr(module, "lenses", lambda problem, cell: made.cameras)
    for variance in (0.99 * limit, 1.01 * limit):
        for other, best in ((0.5 * variance, "alone"), (2.0 * variance, "bent")):
            found = {id(bent): (variance, ("bent",)), id(made.cameras): (other, ("alone",))}
            monkeypatch.setattr(module, "_scale_and_points", lambda problem, at, of, found=found: found[id(at.cameras)])
            kept = agreeing_points(problem, state, [np.array([0])], made.cell)
            assert kept == ((best if is_free and variance > limit else "bent"),)
