"""The scene: where it opens, what it shows, arms by their URDF."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
from tests.shared.stages import without_stages

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.stages.concluding import find_error_at_task
from basecal.cell import ErrorMap, Residuals, SampleResidual
from basecal.kinematics import read_chain
from basecal.reporting.cell_view.picture import picture
from basecal.reporting.cell_view.scene import scene, scene_data
from basecal.simulation import Scenario, simulate
from shared.bodies import arm_with_bodies

no_error_at_task = without_stages(find_error_at_task)


def test_it_opens_at_the_worst_sample_which_is_always_shown():
    """Of many samples some are shown, the worst among them."""
    made = simulate(Scenario(samples=6), 0)
    calibration = calibrate(made.cell, made.recording)
    samples = [replace(made.recording.samples[k % 6], sample=k) for k in range(1000)]
    views = tuple(SampleResidual(k, "wrist", "board", 0.2 + (k == 701)) for k in range(1000))
    drawn = scene(made.cell, samples, replace(calibration, residuals=Residuals(per_sample=views)))
    assert drawn.samples[drawn.opening] == 701
    assert len(drawn.samples) <= 401
    assert "reprojection error 1.2 px" in drawn.labels[drawn.opening]


def test_it_opens_at_the_first_sample_if_none_is_the_worst():
    """Of a calibration without residuals."""
    made = simulate(Scenario(samples=3), 0)
    calibration = replace(calibrate(made.cell, made.recording), residuals=Residuals())
    assert scene(made.cell, made.recording.samples, calibration).opening == 0


def test_a_camera_shows_what_its_lens_sees():
    """The rays of its frustum go through the corners of the image, by the stated lens if none was estimated."""
    made = simulate(Scenario(samples=4), 0)
    drawn = scene(made.cell, made.recording.samples, calibrate(made.cell, made.recording))
    (camera,) = (body for body in drawn.bodies if body.kind == "camera")
    corners = made.cell.cameras["wrist"].intrinsics.camera.project(camera.lines[:4, 1])
    np.testing.assert_allclose(np.sort(corners, axis=0), [[0, 0], [0, 0], [1279, 719], [1279, 719]], atol=0.1)


def test_arms_stand_by_their_joints():
    """Places of joints in the base lead from it to the flange; a robot known by poses has none."""
    made = simulate(Scenario(samples=5, joints=True), 0)
    drawn = scene(made.cell, made.recording.samples, calibrate(made.cell, made.recording))
    for arm in drawn.arms:
        chain = made.cell.robots[arm.name].chain
        for place, sample in enumerate(made.recording.samples):
            last = chain.joint_frames(sample.robots[arm.name].joints_rad)[-1] @ chain.tip
            np.testing.assert_allclose(last.translation, arm.base_from_flange[place].translation, atol=1e-12)
            np.testing.assert_allclose(
                arm.joints[place, -1].translation,
                chain.joint_frames(sample.robots[arm.name].joints_rad)[-1].translation,
            )
    data = json.loads(json.dumps(scene_data(drawn)))
    assert np.shape(data["arms"][0]["joints"]) == (5, 6, 3)
    assert 'class="links robot-0"' in picture(drawn)
    by_pose = simulate(Scenario(samples=5), 0)
    posed = scene(by_pose.cell, by_pose.recording.samples, calibrate(by_pose.cell, by_pose.recording))
    assert [arm.joints for arm in posed.arms] == [None, None]
    assert 'class="reach robot-0"' in picture(posed)


def test_a_sample_without_joints_hides_its_arm():
    """It is drawn at zero and marked as not known."""
    made = simulate(Scenario(samples=5, joints=True), 0)
    calibration = calibrate(made.cell, made.recording)
    first, *others = made.recording.samples
    lacking = replace(first, robots={"eye": first.robots["eye"]})
    drawn = scene(made.cell, [lacking, *others], calibration)
    hand = next(arm for arm in drawn.arms if arm.name == "hand")
    assert hand.known.tolist() == [False, True, True, True, True]
    assert hand.joints.translation.shape == (5, 6, 3)


def test_bodies_of_links_are_drawn_if_all_can_be_read(tmp_path):
    """Surfaces with whole poses of joints; if a mesh is missing, places of joints alone."""
    made = simulate(Scenario(samples=4, joints=True), 0)
    calibration = calibrate(made.cell, made.recording)
    chain = read_chain(arm_with_bodies(tmp_path), "base_link", "wrist_3")
    bodied = {name: replace(robot, chain=chain) for name, robot in made.cell.robots.items()}
    data = scene_data(scene(replace(made.cell, robots=bodied), made.recording.samples, calibration))
    assert [each["frame"] for each in data["arms"][0]["surfaces"]] == [body.frame for body in chain.collisions]
    assert np.shape(data["arms"][0]["joints"]) == (4, 6, 7)
    (tmp_path / "arm_description/meshes/upper.stl").unlink()
    data = scene_data(scene(replace(made.cell, robots=bodied), made.recording.samples, calibration))
    assert data["arms"][0]["surfaces"] == []
    assert np.shape(data["arms"][0]["joints"]) == (4, 6, 3)


def test_the_worst_place_is_named():
    """In the data of the script and on the still image, with the error there."""
    made = simulate(Scenario(samples=4), 0)
    errors = ErrorMap(np.array([[0.5, 0, 0.2], [0.6, 0, 0.2]]), np.array([1e-3, 2.34e-3]), np.zeros(2))
    drawn = scene(made.cell, made.recording.samples, replace(calibrate(made.cell, made.recording), error_map=errors))
    assert scene_data(drawn)["errors"] == {
        "points": [[0.5, 0, 0.2], [0.6, 0, 0.2]],
        "mm": [1.0, 2.34],
        "worst": "worst place: 2.3 mm",
    }
    assert "worst place: 2.3 mm" in picture(drawn)
