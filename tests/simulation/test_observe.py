"""What cameras report: the truth, with noise of the sigmas asked for."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.simulation.layout import make_layout
from basecal.simulation.motion import draw_motions, points_in_camera, seen_points
from basecal.simulation.observe import observe
from basecal.simulation.scenario import Scenario
from basecal.simulation.scene import draw_scene

VIEW = ("wrist", "board")


def observed(scenario):
    """The scene, the motion, and what is seen in it."""
    scene = draw_scene(scenario, make_layout(scenario.layout), np.random.default_rng(1))
    (motion,) = draw_motions(scene, scenario, np.random.default_rng(2), {})
    return scene, motion, observe(motion, scene, scenario, np.random.default_rng(3))


def residuals(scenario):
    """Pixels less those of the truth, by sample."""
    scene, motion, seen = observed(scenario)
    exact = scene.lenses["wrist"].project(points_in_camera(scene, VIEW, motion.true))
    return [found.pixels - exact[k] for k, (found,) in enumerate(seen)]


def test_without_noise_the_truth_is_seen():
    """All corners of a whole board, by their ids."""
    scenario = Scenario(samples=3, pixel_px=0.0)
    scene, _, seen = observed(scenario)
    assert all(np.array_equal(found.ids, scene.shapes["board"].ids) for (found,) in seen)
    assert max(np.abs(each).max() for each in residuals(scenario)) < 1e-9


def test_errors_in_common_are_those_of_a_view():
    """Points scatter by their own sigma, views' means by that in common; 300 views tell both to a tenth."""
    off = residuals(Scenario(samples=300, target="points", pixel_px=0.1, correlated_px=0.5))
    means = np.array([each.mean(0) for each in off])
    assert means.std() == pytest.approx(0.5, rel=0.1)
    assert np.concatenate([each - each.mean(0) for each in off]).std() == pytest.approx(0.1, rel=0.15)


def test_only_points_that_are_seen_are_reported():
    """Of a part of a board, each by its own id."""
    scenario = Scenario(samples=20, distance_m=(0.25, 0.35), position_m=0.2, partial=True, pixel_px=0.0)
    scene, motion, seen = observed(scenario)
    mask = seen_points(scene, scenario, VIEW, motion.true)
    assert not mask.all()
    for k, (found,) in enumerate(seen):
        assert found.ids.tolist() == scene.shapes["board"].ids[mask[k]].tolist()
    assert max(np.abs(each).max() for each in residuals_of(scene, motion, seen, mask)) < 1e-9


def residuals_of(scene, motion, seen, mask):
    exact = scene.lenses["wrist"].project(points_in_camera(scene, VIEW, motion.true))
    return [found.pixels - exact[k][mask[k]] for k, (found,) in enumerate(seen)]


@pytest.mark.parametrize("states", [True, False])
def test_poses_err_in_the_axes_of_the_target(states):
    """Translation and rotation by their sigmas, which the recording states or not."""
    scenario = Scenario(samples=300, target="pose", pose_noise=(1e-3, 4e-3), state_observation_noise=states)
    scene, motion, seen = observed(scenario)
    true = scene.camera_from_target(VIEW, motion.true)
    off = np.stack([(true[k].inverse() @ found.camera_from_target).log() for k, (found,) in enumerate(seen)])
    np.testing.assert_allclose(off.std(0), np.repeat([1e-3, 4e-3], 3), rtol=0.15)
    sigma = seen[0][0].sigma
    assert sigma is None if not states else sigma.tolist() == [1e-3] * 3 + [4e-3] * 3


@pytest.mark.parametrize(
    ("point_m", "states", "stated"), [(2e-3, True, True), (2e-3, False, False), (0.0, True, False)]
)
def test_points_in_space_err_by_their_sigma(point_m, states, stated):
    """Sigmas are stated where there are any and the scenario says so."""
    scenario = Scenario(samples=100, target="points3d", point_m=point_m, state_observation_noise=states)
    scene, motion, seen = observed(scenario)
    exact = points_in_camera(scene, VIEW, motion.true)
    off = np.stack([found.points_in_camera - exact[k] for k, (found,) in enumerate(seen)])
    assert off.std() == pytest.approx(point_m, rel=0.1, abs=1e-12)
    assert all((found.sigma_m is not None) == stated for (found,) in seen)
    if stated:
        np.testing.assert_array_equal(seen[0][0].sigma_m, np.full(len(exact[0]), point_m))


def test_every_view_of_a_group_is_reported_at_once():
    """Two cameras, in the order of the views."""
    *_, seen = observed(Scenario(samples=2, layout="two_cameras"))
    assert [[found.camera for found in sample] for sample in seen] == [["left_camera", "right_camera"]] * 2
