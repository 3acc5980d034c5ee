"""Tests of the stated cell: the part of a simulation's truth that a solver receives."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.simulation.arms import with_arms
from basecal.simulation.layout import make_layout
from basecal.simulation.scenario import Scenario
from basecal.simulation.scene import draw_scene
from basecal.simulation.stated_cell import stated_cell, truth


def make_stated_cell(seed=0, **fields):
    """Scene of a scenario and its stated cell."""
    scenario = Scenario(**fields)
    scene = draw_scene(scenario, make_layout(scenario.layout), np.random.default_rng(1))
    scene, arms = with_arms(scene, scenario, np.random.default_rng(2)) if scenario.joints else (scene, {})
    return scene, stated_cell(scene, scenario, np.random.default_rng(seed), arms)


def test_free_transforms_have_no_value():
    """Free bases and mounts have no value, and fixed ones have the true one."""
    scene, cell = make_stated_cell(base="free", camera_mount="fixed", target_mount="fixed")
    assert cell.bases["hand"].mean is None
    assert cell.cameras["wrist"].mount.mean is scene.mounts["wrist"]
    assert cell.targets["board"].mount.mean is scene.mounts["board"]


def test_prior_errors_have_stated_sigmas():
    """Normalised errors of 50 priors (300 tangent components) have a root mean square of one within 10 %."""
    off = []
    for seed in range(50):
        scene, cell = make_stated_cell(seed, base="prior", base_prior=(0.01, 0.02))
        prior = cell.bases["hand"]
        np.testing.assert_array_equal(prior.sigma, [0.01] * 3 + [0.02] * 3)
        off.append((prior.mean.inverse() @ scene.bases["hand"]).log() / prior.sigma)
    assert np.sqrt(np.mean(np.square(off))) == pytest.approx(1.0, abs=0.1)


def test_prior_of_led_has_no_rotation():
    """The prior of an LED has no rotation, like its truth; that of a board has."""
    _, cell = make_stated_cell(target="led", target_mount="prior")
    np.testing.assert_array_equal(cell.targets["board"].mount.mean.rotation, np.eye(3))
    assert (
        np.abs(make_stated_cell(target="charuco", target_mount="prior")[1].targets["board"].mount.mean.rotvec).max() > 0
    )


def test_stated_lens_follows_its_status():
    """A fixed lens is exact, and a prior has errors of its sigmas.

    A free lens has only its number of distortion terms, and a camera that measures poses has no lens.
    """
    scene, cell = make_stated_cell(intrinsics="fixed")
    lens = scene.lenses["wrist"]
    assert cell.cameras["wrist"].intrinsics.camera is lens
    free = make_stated_cell(intrinsics="free")[1].cameras["wrist"].intrinsics
    assert (free.camera, free.distortion_terms) == (None, len(lens.distortion))
    prior = make_stated_cell(intrinsics="prior", intrinsics_prior=(4.0, 3.0, 0.02))[1].cameras["wrist"].intrinsics
    assert prior.sigma.tolist() == [4.0, 4.0, 3.0, 3.0] + [0.02] * len(lens.distortion)
    off = (prior.camera.parameters - lens.parameters) / prior.sigma
    assert 0.1 < np.abs(off).max() < 5
    poses = make_stated_cell(target="pose")[1].cameras["wrist"]
    assert poses.intrinsics is None
    assert poses.size_px is None


@pytest.mark.parametrize(
    ("fields", "pixel", "common"),
    [
        ({"pixel_px": 0.3}, 0.3, None),
        ({"pixel_px": 0.3, "correlated_px": 0.1}, 0.3, 0.1),
        ({"pixel_px": 0.3, "correlated_px": 0.1, "state_pixel_noise": False}, None, None),
        ({"pixel_px": 0.0, "correlated_px": 0.1}, None, None),
        ({"pixel_px": 0.3, "target": "pose"}, None, None),
        ({"pixel_px": 0.3, "target": "points3d"}, None, None),
    ],
)
def test_pixel_noise_is_stated_if_present(fields, pixel, common):
    """The cell states pixel noise if there is any and the scenario allows it."""
    _, cell = make_stated_cell(**fields)
    assert (cell.pixel_px, cell.correlated_px) == (pixel, common)


def test_robot_noise_is_stated_if_present():
    """The cell states three sigmas of translation and three of rotation.

    It states none if the noise is zero or is to be unstated.
    """
    noise = (1e-3, 2e-3)
    assert make_stated_cell(robot_noise=noise)[1].robots["eye"].noise.tolist() == [1e-3] * 3 + [2e-3] * 3
    assert make_stated_cell(robot_noise=noise, state_robot_noise=False)[1].robots["eye"].noise is None
    assert make_stated_cell()[1].robots["eye"].noise is None


def test_arms_state_parameter_priors():
    """A prior has the true sigmas of the parameters, free parameters have none, and fixed ones are not stated."""
    fields = {"joint_offset_rad": 0.01, "link_error": (1e-3, 2e-3), "compliance": 1e-4}
    _, cell = make_stated_cell(joints=True, joint_offsets="prior", link_parameters="prior", deflection="free", **fields)
    robot = cell.robots["eye"]
    assert robot.chain is not None
    assert robot.parameters["joint_offsets"].sigma_rad == 0.01
    assert (robot.parameters["link_parameters"].sigma_m, robot.parameters["link_parameters"].sigma_rad) == (1e-3, 2e-3)
    assert robot.parameters["deflection"].status == "free"
    assert robot.parameters["deflection"].sigma_rad_per_nm is None
    assert make_stated_cell(joints=True)[1].robots["eye"].parameters == {}
    assert make_stated_cell()[1].robots["eye"].chain is None


def test_target_of_pose_camera_has_no_shape():
    """The target has its shape, unless poses are observed."""
    scene, cell = make_stated_cell()
    assert cell.targets["board"].target is scene.shapes["board"]
    assert make_stated_cell(target="pose")[1].targets["board"].target is None


def test_truth_has_every_transform():
    """The truth has the same names of transforms as the cell."""
    scene, cell = make_stated_cell()
    named = truth(scene, cell)
    assert named.keys() == cell.transforms.keys()
    assert named["eye_base_from_hand_base"] is scene.bases["hand"]
    assert named["eye_flange_from_wrist"] is scene.mounts["wrist"]


def test_default_priors_are_rough():
    """Default priors have sigmas of a centimetre for bases, 5 mm for mounts, and 5 px and 0.01 for lenses."""
    _, cell = make_stated_cell(base="prior", camera_mount="prior", target_mount="prior", intrinsics="prior")
    np.testing.assert_array_equal(cell.bases["hand"].sigma, [0.01] * 3 + [0.02] * 3)
    for thing in (cell.cameras["wrist"], cell.targets["board"]):
        np.testing.assert_array_equal(thing.mount.sigma, [0.005] * 3 + [0.05] * 3)
    assert cell.cameras["wrist"].intrinsics.sigma.tolist() == [5.0] * 4 + [0.01] * 5
