"""Tests of `lens_structures`: residuals that depend on the image position and do not fit the lens model."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import f as fisher
from scipy.stats import ttest_1samp
from tests.simulated_problem import simulated_problem

from basecal.accuracy import lens_structure
from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.covariance.widening import widen
from basecal.accuracy.lens_structure import (
    LensStructure,
    _answer_step,
    _camera_structure,
    _chance,
    _choose_terms,
    _estimate_sizes,
    _project,
    _single_view_poses,
    _stack_views,
    _term_derivatives,
    lens_structures,
)
from basecal.accuracy.model_comparison.nested_models import SINGLE_LEVEL
from basecal.accuracy.residuals.fit import single_view_pose
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.geometry import SE3, Camera
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"
SETTINGS = Settings()
# Only the term along the image height by the squared radius: no lens of five terms contains it.
BEND = np.array([0.0, 0.0, 0.0, 0.1, 0.0])


def simulate_cell(seed, samples=30, **changed):
    return simulate(Scenario(samples=samples, robot_noise=(1e-4, 2e-4), intrinsics="free", **changed), seed)


def distort(cell, size=BEND):
    """The recording of a simulated cell with a distortion that the lens model cannot have."""
    problem, _ = build_problem(cell.cell, cell.recording)
    (group,) = problem.groups
    state = State(cell.truth, cell.cameras, np.zeros((len(problem.stops), 6)))
    points = group.measurement.camera_points(state.camera_from_target(group, problem.stops))
    shift = _term_derivatives(cell.cameras["wrist"], points) @ size
    samples = []
    for k, sample in enumerate(cell.recording.samples):
        (seen,) = sample.observations
        rows = cell.cell.targets["board"].target.rows(seen.ids)
        samples.append(replace(sample, observations=(replace(seen, pixels=seen.pixels + shift[k, rows]),)))
    return replace(cell.recording, samples=tuple(samples))


@pytest.mark.journey
def test_correct_lens_model_has_no_structure():
    """Five recordings with the model's own lens show no structure, at a level of one in 10,000."""
    cells = (simulate_cell(seed, samples=20) for seed in range(5))
    assert all(lens_structures(solve(c.cell, c.recording), SETTINGS) == [] for c in cells)


def test_distortion_is_found_with_size_and_effect():
    """A term of 0.1 distorts by 2.5 px rms at the points, and the widened covariance covers its effect.

    Centre, tilt and mount together absorb most of it.
    """
    cell = simulate_cell(2)
    solution = solve(cell.cell, distort(cell))
    (found,) = lens_structures(solution, SETTINGS)
    assert found.camera == "wrist"
    assert found.chance < 1e-5
    assert found.rms_px == pytest.approx(2.5, rel=0.3)
    off = (solution.state.transforms[BASE].inverse() @ cell.truth[BASE]).log()
    alone, both = (s.joint_transform_covariance([BASE]) for s in (solution, widen(solution, found.moved)))
    assert off @ np.linalg.solve(both, off) < off @ np.linalg.solve(alone, off)


@pytest.mark.slow
def test_calibrate_names_lens_structure():
    """`calibrate` reports the structure as an info, since the answer moves by less than its sigmas.

    A clean recording has none.
    """
    cell = simulate_cell(1)
    found = calibrate(cell.cell, distort(cell))
    (finding,) = (f for f in found.findings if f.code == "lens-model")
    assert (finding.severity, finding.about) == ("info", ("wrist",))
    assert "depend on their position in the image" in finding.what
    assert not [f for f in calibrate(cell.cell, cell.recording).findings if f.code == "lens-model"]


def test_shared_score_is_compared_with_scatter_of_views():
    """For one term and forty views of unit information, the chance equals Student's t test, whatever the scale."""
    values = np.random.default_rng(0).standard_normal((40, 1))
    information = np.ones((40, 1, 1))
    for shift in (0.0, 0.5):
        scores = values - values.mean(0) + shift
        expected = ttest_1samp(scores[:, 0], 0.0).pvalue
        assert _chance(scores, information, scores.mean(0)) == pytest.approx(expected, abs=1e-12)
        assert _chance(7 * scores, information, 7 * scores.mean(0)) == pytest.approx(expected, abs=1e-12)


def test_unseen_terms_have_no_freedom():
    """If each view sees one of two terms, there are as many freedoms as views, less two."""
    rng = np.random.default_rng(1)
    information = np.zeros((40, 2, 2))
    information[np.arange(40), np.arange(40) % 2, np.arange(40) % 2] = 1.0
    scores = np.where(np.diagonal(information, axis1=1, axis2=2) > 0, rng.standard_normal((40, 2)), 0.0)
    size = scores.sum(0) / 20
    apart = np.sum((scores - information @ size) ** 2)
    expected = fisher.sf(20 * np.sum(size**2) / 2 / (apart / 38), 2, 38)
    assert _chance(scores, information, size) == pytest.approx(expected)


def test_known_columns_do_not_affect_other_sizes():
    """Sizes of the other columns, and their chance, are independent of the known columns' share."""
    rng = np.random.default_rng(0)
    known, columns, sizes = rng.normal(size=(8, 6, 2)), rng.normal(size=(8, 6, 3)), np.array([0.5, -1.0, 2.0])
    residual = columns @ sizes + rng.normal(size=(8, 6))
    found, chance = _estimate_sizes(residual, known, columns)
    shared = _estimate_sizes(residual + known @ np.array([30.0, -20.0]), known, columns)
    np.testing.assert_allclose(shared[0], found, rtol=1e-9)
    assert shared[1] == pytest.approx(chance, rel=1e-6)
    np.testing.assert_allclose(found, sizes, atol=0.7)


CAMERA = Camera("pinhole", np.array([600.0, 500.0, 320.0, 240.0, 0.1, -0.05, 1e-3, -2e-3, 0.02]))


def test_term_derivatives_use_squared_radius():
    """Term derivatives are powers of the squared radius: the fourth along the ray, first and second along the sides.

    Each is multiplied by the focal lengths.
    """
    points = np.array([[[0.2, -0.4, 2.0], [0.9, 0.3, 0.5]]])
    for p, found in zip(points[0], _term_derivatives(CAMERA, points)[0], strict=True):
        x, y = p[0] / p[2], p[1] / p[2]
        s = x * x + y * y
        expected = [[x * s * s * s * s, s, s * s, 0, 0], [y * s * s * s * s, 0, 0, s, s * s]]
        np.testing.assert_allclose(found, [np.multiply(600.0, expected[0]), np.multiply(500.0, expected[1])])


def drawn_views(views=40, rows=12):
    """Columns of a lens and of other terms, and noise, of views."""
    rng = np.random.default_rng(3)
    return (rng.normal(size=(views, rows, k)) for k in (2, 5, 1))


@pytest.mark.parametrize(
    "size", [[0.0, 0, 0, 0, 0], [0.3, 0, 0, 0, 0], [0, 0.2, -0.3, 0.4, 0.25], [0.5, 0.2, -0.3, 0.4, 0.25]]
)
def test_terms_are_chosen_by_families(size):
    """Terms are chosen by families, those along the image sides together; families without a part stay zero."""
    own, other, noise = drawn_views()
    size = np.array(size)
    residual = own @ np.array([5.0, -7.0]) + other @ size + 0.02 * noise[..., 0]
    found, chance = _choose_terms(residual, own, other)
    np.testing.assert_allclose(found, size, atol=0.01)
    np.testing.assert_array_equal(found == 0, size == 0)
    assert chance == 1.0 if not size.any() else chance < 1e-20


def test_families_share_alarm_level():
    """Each of two families has half of the significance level: a fifth below it is reported, a fifth above not."""
    own, other, noise = drawn_views()

    def chance_of(size):
        return _estimate_sizes(size * other[..., 0] + noise[..., 0], own, other[..., [0]])[1]

    for share in (0.8, 1.2):
        size = brentq(lambda x, p=share: np.log(chance_of(x) / (p * SINGLE_LEVEL / 2)), 0.05, 1.0)
        found, chance = _choose_terms(size * other[..., 0] + noise[..., 0], own, other)
        assert np.any(found) == (share < 1)
        assert chance == pytest.approx(share * SINGLE_LEVEL / 2 if share < 1 else 1.0, rel=1e-6)


def test_chance_is_smallest_of_families():
    """The stated chance is the smallest of the families; a second family does not increase it."""
    own, other, noise = drawn_views()
    residual = 1.0 * other[..., 0] + 0.1 * other[..., 2] + 0.3 * noise[..., 0]
    found, chance = _choose_terms(residual, own, other)
    assert np.all(found)
    assert chance == _estimate_sizes(residual, own, other[..., [0]])[1]


def test_columns_are_orthogonal_to_known_ones():
    """Known columns added to the others change neither sizes nor chance."""
    rng = np.random.default_rng(0)
    known, columns = rng.normal(size=(8, 6, 2)), rng.normal(size=(8, 6, 3))
    residual = columns @ np.array([0.5, -1.0, 2.0]) + rng.normal(size=(8, 6))
    found, chance = _estimate_sizes(residual, known, columns)
    mixed = _estimate_sizes(residual, known, columns + known @ rng.normal(size=(2, 3)))
    np.testing.assert_allclose(mixed[0], found, rtol=1e-9)
    assert mixed[1] == pytest.approx(chance, rel=1e-6)


def test_chance_of_fewest_views():
    """Two views have one freedom, one view none; equal views leave no scatter."""
    scores = np.array([[0.3], [1.1]])
    information = np.ones((2, 1, 1))
    expected = ttest_1samp(scores[:, 0], 0.0).pvalue
    assert _chance(scores, information, scores.mean(0)) == pytest.approx(expected, abs=1e-12)
    assert _chance(scores[:1], information[:1], scores[0]) == 1.0
    assert _chance(np.ones((4, 1)), np.ones((4, 1, 1)), np.ones(1)) == 1.0
    for of in np.random.default_rng(0).normal(size=(20, 1, 3)):  # as many freedoms as terms, up to rounding
        assert _chance(of @ np.diag([2.0, 3.0, 7.0]), np.diag([2.0, 3.0, 7.0])[None], of[0]) == 1.0


def test_views_with_fewer_points_are_padded():
    """Views with fewer points are padded with zero rows, in the order of the targets."""
    few, many = np.arange(1.0, 13.0).reshape(2, 2, 3), np.arange(1.0, 13.0).reshape(1, 4, 3)
    found = _stack_views((few, many))
    assert found.shape == (3, 4, 3)
    np.testing.assert_array_equal(found[:2, :2], few)
    np.testing.assert_array_equal(found[:2, 2:], 0.0)
    np.testing.assert_array_equal(found[2:], many)
    flat = _stack_views((few[..., 0], many[..., 0]))
    np.testing.assert_array_equal(flat, found[..., 0])


@pytest.fixture(scope="module")
def solved():
    """Twelve views of the model's own lens, solved."""
    cell = simulate_cell(2, samples=12)
    return solve(cell.cell, cell.recording)


@pytest.mark.parametrize("at_a_time", [2, 5, 400])
def test_single_view_poses_cover_solvable_views(solved, monkeypatch, at_a_time):
    """All views that give a pose are included in order, in chunks of any size; a view of three points gives none."""
    monkeypatch.setattr(lens_structure, "_CHUNK_VIEWS", at_a_time)
    (group,) = solved.problem.groups
    seen, weight = group.measurement.seen.copy(), group.measurement.weight.copy()
    seen[3, 3:], weight[3, 3:] = False, 0.0
    group = replace(group, measurement=replace(group.measurement, seen=seen, weight=weight))
    found = _single_view_poses(solved, group)
    assert len(found) == -(-11 // at_a_time)
    others = np.delete(np.arange(12), 3)
    np.testing.assert_array_equal(np.concatenate([few.pixels for few, _ in found]), group.measurement.pixels[others])
    predicted = solved.state.camera_from_target(group, solved.problem.stops)
    expected = single_view_pose(solved.state, group, predicted)[0][others]
    np.testing.assert_array_equal(np.concatenate([alone.translation for _, alone in found]), expected.translation)


def test_pose_observations_have_no_lens_structure():
    """A target observed as poses has no lens structure."""
    problem = simulated_problem(Scenario(samples=3, target="pose"))
    state = SimpleNamespace(camera_from_target=lambda group, stops: group.measurement.measured_camera_from_target)
    assert _single_view_poses(SimpleNamespace(problem=problem, state=state), problem.groups[0]) == []


def test_projection_removes_pose_columns(solved):
    """Weighted residuals and columns lose their part along the pose columns, by differences, view by view."""
    ((few, alone),) = _single_view_poses(solved, solved.problem.groups[0])
    few, alone = few.take(np.arange(2)), alone[np.arange(2)]
    weight = few.weight * np.random.default_rng(0).uniform(0.1, 2.0, few.weight.shape)
    weight[1, 4] = 0.0
    few = replace(few, weight=weight)
    found = _project(few, alone, CAMERA)

    def pixels(pose, camera=CAMERA):
        return camera.project(few.camera_points(pose))

    bend = _term_derivatives(CAMERA, few.camera_points(alone))
    bend[1, 4] = 0.0
    steps = np.maximum(1e-6, 1e-6 * np.abs(CAMERA.parameters))
    lens = [CAMERA.with_parameters(CAMERA.parameters + s * e) for s, e in zip(steps, np.eye(9), strict=True)]
    back = [CAMERA.with_parameters(CAMERA.parameters - s * e) for s, e in zip(steps, np.eye(9), strict=True)]
    by_lens = np.stack(
        [(pixels(alone, a) - pixels(alone, b)) / (2 * s) for a, b, s in zip(lens, back, steps, strict=True)], -1
    )
    by_pose = np.stack(
        [(pixels(alone @ SE3.exp(1e-6 * e)) - pixels(alone @ SE3.exp(-1e-6 * e))) / 2e-6 for e in np.eye(6)], -1
    )
    for k in range(2):
        w = np.repeat(weight[k], 2)[:, None]
        pose = w * by_pose[k].reshape(-1, 6)
        keep = np.eye(len(pose)) - pose @ np.linalg.pinv(pose)
        off = w[:, 0] * (few.pixels - pixels(alone))[k].ravel()
        np.testing.assert_allclose(found.residual[k], keep @ off, atol=1e-5 * np.abs(off).max())
        for columns, expected in ((found.of_lens, by_lens), (found.of_terms, bend)):
            expected = keep @ (w * expected[k].reshape(len(w), -1))
            np.testing.assert_allclose(columns[k], expected, atol=1e-5 * np.abs(expected).max())
        np.testing.assert_array_equal(found.in_pixels[k], bend[k].reshape(-1, 5))


def test_point_behind_camera_is_omitted(solved):
    """A point behind the camera has zero residual and columns, whatever its weight."""
    ((few, alone),) = _single_view_poses(solved, solved.problem.groups[0])
    few, alone = few.take(np.arange(1)), alone[np.arange(1)]
    behind = few.points_in_target.copy()
    behind[5] = (alone[0].inverse() @ np.array([[0.01, 0.02, -0.5]]))[0]
    found = _project(replace(few, points_in_target=behind), alone, CAMERA)
    rows = slice(10, 12)
    for part in found:
        assert np.all(np.isfinite(part))
        np.testing.assert_array_equal(part[0, rows], 0.0)


def duplicate_views(solution):
    """The views again as those of another camera with another lens."""
    (group,) = solution.problem.groups
    cameras = {**solution.state.cameras, "other": CAMERA}
    problem = solution.problem.with_groups([group, replace(group, camera="other").take(np.arange(4))])
    return replace(solution, problem=problem, state=replace(solution.state, cameras=cameras))


def test_each_camera_uses_own_views(solved, monkeypatch):
    """Each camera with pixels is judged by its own views; one without structure is not reported."""
    structure = LensStructure("wrist", 1.0, 0.0, np.zeros(1))
    monkeypatch.setattr(
        lens_structure, "_camera_structure", lambda solution, name, settings: structure if name == "wrist" else None
    )
    assert lens_structures(duplicate_views(solved), SETTINGS) == [structure]
    assert lens_structures(replace(solved, converged=False), SETTINGS) == []


def test_rms_covers_seen_points(solved, monkeypatch):
    """The size is the rms over both coordinates of seen points.

    It is omitted if no term is significant, or with four views.
    """
    two, size = duplicate_views(solved), np.array([0.0, 2.0, -1.0, 0.5, 0.25])
    monkeypatch.setattr(lens_structure, "_choose_terms", lambda residual, own, other: (size, 1e-9))
    monkeypatch.setattr(lens_structure, "_answer_step", lambda solution, name, size, settings: 2 * size)
    found = _camera_structure(two, "wrist", SETTINGS)
    ((few, alone),) = _single_view_poses(solved, solved.problem.groups[0])
    shift = (_term_derivatives(solved.state.cameras["wrist"], few.camera_points(alone)) @ size)[few.weight > 0]
    assert (found.camera, found.chance) == ("wrist", 1e-9)
    assert found.rms_px == pytest.approx(np.sqrt(np.sum(shift**2) / shift.size), rel=1e-12)
    np.testing.assert_array_equal(found.moved, 2 * size)
    assert _camera_structure(two, "other", SETTINGS) is None
    monkeypatch.setattr(lens_structure, "_choose_terms", lambda residual, own, other: (np.zeros(5), 1.0))
    assert _camera_structure(two, "wrist", SETTINGS) is None


@pytest.mark.parametrize("count", [9, 10])
def test_lens_structure_needs_ten_views(solved, monkeypatch, count):
    """Ten views are enough to compare with their scatter, nine are not."""
    monkeypatch.setattr(lens_structure, "_choose_terms", lambda residual, own, other: (np.ones(5), 0.0))
    monkeypatch.setattr(lens_structure, "_answer_step", lambda *_: np.zeros(1))
    (group,) = solved.problem.groups
    few = replace(solved, problem=solved.problem.with_groups([group.take(np.arange(count))]))
    assert (_camera_structure(few, "wrist", SETTINGS) is None) == (count < 10)


def test_answer_step_equals_that_of_undistorted_pixels(solved):
    """Removing the distortion that was added to the pixels leads back to the previous answer."""
    size = np.array([0.0, 0.5, 0.0, -0.5, 0.0])
    (group,) = solved.problem.groups
    points = group.measurement.camera_points(solved.state.camera_from_target(group, solved.problem.stops))
    shift = _term_derivatives(solved.state.cameras["wrist"], points) @ size
    bent_group = replace(group, measurement=replace(group.measurement, pixels=group.measurement.pixels + shift))
    bent_solution = replace(solved, problem=solved.problem.with_groups([bent_group]))
    moved = _answer_step(bent_solution, "wrist", size, SETTINGS)
    there = _answer_step(solved, "wrist", -size, SETTINGS)
    sigmas = np.sqrt(np.diag(solved.covariance))
    assert np.abs(there / sigmas).max() > 3
    assert np.abs(moved / sigmas).max() < 0.1
    np.testing.assert_allclose(_answer_step(solved, "other", size, SETTINGS) / sigmas, 0.0, atol=1e-4)
