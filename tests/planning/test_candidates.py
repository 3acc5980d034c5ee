"""Tests of candidate samples of a plan."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Sample
from basecal.errors import InputError
from basecal.estimation.settings import Settings
from basecal.geometry import SE3
from basecal.planning.candidates import candidates, draw_feasible, draw_in_ball
from basecal.planning.feasible import is_feasible
from basecal.planning.prospects import sketches
from basecal.simulation import Scenario, simulate


def make_sketch(**scenario):
    """Sketch of a calibrated cell, and the robot states of its recording."""
    simulated = simulate(Scenario(samples=12, **scenario), 3)
    sketch = sketches(simulated.cell, calibrate(simulated.cell, simulated.recording, Settings(robot_noise="stated")))[0]
    return sketch, [dict(sample.robots) for sample in simulated.recording.samples]


@pytest.fixture(scope="module")
def two_arms():
    return make_sketch()


def farthest(sketch, taught, found):
    """Largest rotation [rad] of an arm from the nearest taught pose, and largest translation of its flange [m]."""
    rotations, translations = [], []
    for sample in found:
        for robot, state in sample.robots.items():
            poses = SE3.stack([sketch.base_from_flange(robot, each[robot]) for each in taught])
            moved = poses.inverse() @ sketch.base_from_flange(robot, state)
            rotations.append(np.linalg.norm(moved.rotvec, axis=-1).min())
            translations.append(np.linalg.norm(moved.translation, axis=-1).min())
    return max(rotations), max(translations)


@pytest.mark.journey
@pytest.mark.parametrize("scenario", [{}, {"joints": True}, {"layout": "eye_to_hand"}, {"layout": "eye_in_hand"}])
def test_every_candidate_is_feasible(scenario):
    """Candidates are feasible for arms with poses and with joints, and for cameras or targets on the world.

    They are numbered and distinct.
    """
    sketch, taught = make_sketch(**scenario)
    found = candidates(sketch, taught, 30, seed=1)
    most_rad = farthest(sketch, taught, found)[0]
    assert most_rad <= (1.0 if scenario.get("joints") else 0.6)
    assert (most_rad > 0.6) == bool(scenario.get("joints"))
    assert len(found) == 30
    assert [sample.sample for sample in found] == list(range(30))
    for sample in found:
        assert is_feasible(sketch, sample)
        for robot, state in sample.robots.items():
            assert (state.joints_rad is None) == (taught[0][robot].joints_rad is None)
    places = [sketch.camera_from_target(sample).matrix.round(9).tobytes() for sample in found]
    assert len(set(places)) == 30


def test_candidates_are_reproducible_by_seed(two_arms):
    """The same seed gives the same candidates, another seed others."""
    sketch, taught = two_arms
    first, again, other = (candidates(sketch, taught, 5, seed=s) for s in (1, 1, 2))
    at = [np.stack([sketch.camera_from_target(s).matrix for s in found]) for found in (first, again, other)]
    assert (at[0] == at[1]).all()
    assert not (at[0] == at[2]).all(axis=(-1, -2)).any()


def test_taught_poses_must_see_the_target(two_arms):
    """Taught poses from which the target is not visible are refused, and the error states what to do."""
    sketch, taught = two_arms
    turned = {robot: type(state)(state.base_from_flange.inverse()) for robot, state in taught[0].items()}
    assert not is_feasible(sketch, Sample(0, robots=turned))
    with pytest.raises(InputError, match="Teach poses"):
        candidates(sketch, [turned], 5)


def test_arms_rotate_about_the_target(two_arms):
    """A camera that only rotates keeps its distance to the centre of the target, and rotates at most by its reach."""
    sketch, taught = two_arms
    found = draw_feasible(sketch, taught[:1], 60, {"eye": (0.3, 0.0), "hand": (0.0, 0.0)}, np.random.default_rng(0))
    middle = sketch.target_points.mean(0)
    away = [np.linalg.norm(sketch.camera_from_target(each) @ middle) for each in (Sample(0, robots=taught[0]), *found)]
    np.testing.assert_allclose(away, away[0], rtol=1e-9)
    assert 0.2 < farthest(sketch, taught[:1], found)[0] <= 0.3
    flange = taught[0]["hand"].base_from_flange
    for each in found:
        np.testing.assert_allclose(each.robots["hand"].base_from_flange.matrix, flange.matrix, atol=1e-12)


def test_arms_translate_within_their_reach(two_arms):
    """An arm that only translates keeps its rotation and moves at most by its reach."""
    sketch, taught = two_arms
    found = draw_feasible(sketch, taught[:1], 60, {"eye": (0.0, 0.0), "hand": (0.0, 0.05)}, np.random.default_rng(0))
    most_rad, most_m = farthest(sketch, taught[:1], found)
    assert most_rad < 1e-7
    assert 0.04 < most_m <= 0.05


def test_taught_poses_are_drawn_equally(two_arms):
    """With zero reach all samples are the taught poses, each about equally often."""
    sketch, taught = two_arms
    found = draw_feasible(sketch, taught[:3], 60, {"eye": (0.0, 0.0), "hand": (0.0, 0.0)}, np.random.default_rng(0))
    places = np.array([sketch.camera_from_target(each).translation for each in found])
    at = np.array([sketch.camera_from_target(Sample(0, robots=each)).translation for each in taught[:3]])
    off = np.linalg.norm(places[:, None] - at, axis=-1)
    np.testing.assert_allclose(off.min(1), 0, atol=1e-9)
    assert np.bincount(off.argmin(1), minlength=3).min() > 10


def test_draws_in_ball_are_uniform():
    """The cube of the radius and each direction are uniform."""
    points = draw_in_ball(np.random.default_rng(0), 2000)
    radius = np.linalg.norm(points, axis=1)
    assert points.shape == (2000, 3)
    assert radius.max() <= 1
    np.testing.assert_allclose(np.quantile(radius**3, [0.1, 0.5, 0.9]), [0.1, 0.5, 0.9], atol=0.04)
    np.testing.assert_allclose(points.mean(0), 0, atol=0.05)
    np.testing.assert_allclose(np.mean(points**2, axis=0), 0.2, atol=0.02)


def test_draws_of_array_shape_are_uniform():
    """Each row of an array of draws is within the ball, and the radius is independent of the row."""
    points = draw_in_ball(np.random.default_rng(1), 4, 500)
    radius = np.linalg.norm(points, axis=-1)
    assert points.shape == (4, 500, 3)
    assert radius.max() <= 1
    np.testing.assert_allclose(np.quantile(radius**3, [0.1, 0.5, 0.9], axis=1).T, [[0.1, 0.5, 0.9]] * 4, atol=0.1)
