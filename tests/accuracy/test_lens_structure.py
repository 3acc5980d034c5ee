"""What a lens model cannot have is found by its place in the image, and nothing where the model is right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import f as fisher
from scipy.stats import ttest_1samp

from basecal.accuracy.lens_structure import _bending, _by_pose, _chance, _estimated, lens_structures
from basecal.accuracy.verdict import calibrate
from basecal.accuracy.widening import widened
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"
SETTINGS = Settings()
# Of the bend's five terms only that along the image's height, by the squared radius: no lens of five terms has it.
BEND = np.array([0.0, 0.0, 0.0, 0.1, 0.0])


def made(seed, samples=30, **changed):
    return simulate(Scenario(samples=samples, robot_noise=(1e-4, 2e-4), intrinsics="free", **changed), seed)


def bent(cell, size=BEND):
    """The recording of a simulated cell as a lens bends it that is no model here."""
    problem, _ = build_problem(cell.cell, cell.recording)
    (group,) = problem.groups
    state = State(cell.truth, cell.cameras, np.zeros((len(problem.stops), 6)))
    points = group.measurement.in_camera(state.camera_from_target(group, problem.stops))
    shift = _bending(cell.cameras["wrist"], points) @ size
    samples = []
    for k, sample in enumerate(cell.recording.samples):
        (seen,) = sample.observations
        rows = cell.cell.targets["board"].target.rows(seen.ids)
        samples.append(replace(sample, observations=(replace(seen, pixels=seen.pixels + shift[k, rows]),)))
    return replace(cell.recording, samples=tuple(samples))


def test_a_right_model_is_left_alone():
    """Ten recordings of the model's own lens: none is found, by a test of one in 10,000."""
    cells = (made(seed, samples=20) for seed in range(10))
    assert all(lens_structures(solve(c.cell, c.recording), SETTINGS) == [] for c in cells)


def test_a_bend_is_found_with_its_size_and_what_it_does():
    """A term of 0.1 bends by 2.5 px rms where points are, most of which centre, tilt and mount take up together."""
    cell = made(2)
    solution = solve(cell.cell, bent(cell))
    (found,) = lens_structures(solution, SETTINGS)
    assert found.camera == "wrist"
    assert found.chance < 1e-5
    assert found.rms_px == pytest.approx(2.5, rel=0.3)
    off = (solution.state.transforms[BASE].inverse() @ cell.truth[BASE]).log()
    alone, both = (s.covariance_of([BASE]) for s in (solution, widened(solution, found.moved)))
    assert off @ np.linalg.solve(both, off) < off @ np.linalg.solve(alone, off)


def test_few_views_say_nothing():
    """Nine views do not tell how far they differ, however much is bent."""
    cell = made(2, samples=9)
    assert lens_structures(solve(cell.cell, bent(cell)), SETTINGS) == []


@pytest.mark.slow
def test_calibrate_names_it():
    """An info, since the answer moves by less than its sigmas; a clean recording has none."""
    cell = made(1)
    found = calibrate(cell.cell, bent(cell))
    (told,) = (f for f in found.findings if f.code == "lens-model")
    assert (told.severity, told.about) == ("info", ("wrist",))
    assert "go by their place in the image" in told.message
    assert not [f for f in calibrate(cell.cell, cell.recording).findings if f.code == "lens-model"]


def test_what_views_have_in_common_is_held_against_how_far_they_differ():
    """One term, forty views of unit information: Student's t squared; larger errors of all views change nothing."""
    values = np.random.default_rng(0).standard_normal((40, 1))
    information = np.ones((40, 1, 1))
    for shift in (0.0, 0.5):
        scores = values - values.mean(0) + shift
        expected = ttest_1samp(scores[:, 0], 0.0).pvalue
        assert _chance(scores, information, scores.mean(0)) == pytest.approx(expected, abs=1e-12)
        assert _chance(7 * scores, information, 7 * scores.mean(0)) == pytest.approx(expected, abs=1e-12)


def test_what_a_view_does_not_see_has_no_freedom():
    """Of two terms each view sees one: as many freedoms as views, less two."""
    rng = np.random.default_rng(1)
    information = np.zeros((40, 2, 2))
    information[np.arange(40), np.arange(40) % 2, np.arange(40) % 2] = 1.0
    scores = np.where(np.diagonal(information, axis1=1, axis2=2) > 0, rng.standard_normal((40, 2)), 0.0)
    size = scores.sum(0) / 20
    apart = np.sum((scores - information @ size) ** 2)
    expected = fisher.sf(20 * np.sum(size**2) / 2 / (apart / 38), 2, 38)
    assert _chance(scores, information, size) == pytest.approx(expected)


def test_derivatives_to_the_pose():
    """Against differences, about a pose that is turned."""
    camera_from_target = SE3.from_rotvec([[0.3, -0.2, 0.5]], [[0.1, 0.0, 0.9]])
    points = np.random.default_rng(1).standard_normal((7, 3)) * 0.1
    camera = made(0, samples=4).cameras["wrist"]

    def pixels(tangent):
        pose = camera_from_target @ SE3.exp(np.asarray(tangent))
        return camera.project((pose.rotation[:, None] @ points[..., None])[..., 0] + pose.translation[:, None])

    at = (camera_from_target.rotation[:, None] @ points[..., None])[..., 0] + camera_from_target.translation[:, None]
    _, by_point, _ = camera.project_with_derivatives(at)
    numeric = np.stack([(pixels(1e-6 * e) - pixels(-1e-6 * e)) / 2e-6 for e in np.eye(6)], axis=-1)
    np.testing.assert_allclose(_by_pose(by_point, camera_from_target, points), numeric, atol=1e-3)


def test_what_known_columns_explain_is_none_of_the_others():
    """Sizes of the others, and the chance of what they explain, are the same whatever the known ones' share."""
    rng = np.random.default_rng(0)
    known, columns, sizes = rng.normal(size=(8, 6, 2)), rng.normal(size=(8, 6, 3)), np.array([0.5, -1.0, 2.0])
    residual = columns @ sizes + rng.normal(size=(8, 6))
    found, chance = _estimated(residual, known, columns)
    shared = _estimated(residual + known @ np.array([30.0, -20.0]), known, columns)
    np.testing.assert_allclose(shared[0], found, rtol=1e-9)
    assert shared[1] == pytest.approx(chance, rel=1e-6)
    np.testing.assert_allclose(found, sizes, atol=0.7)
