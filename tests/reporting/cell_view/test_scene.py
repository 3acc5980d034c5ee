"""The scene: where it opens, what it shows, arms by their URDF."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from tests.shared.stages import without_stages

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.stages.concluding import find_error_at_task
from basecal.cell import (
    Calibration,
    Cell,
    CellCamera,
    CellTarget,
    ErrorMap,
    Residuals,
    Robot,
    RobotState,
    Sample,
    SampleResidual,
)
from basecal.cell.targets.apriltag import apriltag_target
from basecal.cell.targets.chessboard import chessboard_target
from basecal.cell.targets.led import led_target
from basecal.geometry import SE3, Camera, PoseEstimate
from basecal.kinematics import read_chain
from basecal.reporting.cell_view.picture import picture
from basecal.reporting.cell_view.scene import frustum, outline, scene, scene_data, worst_words
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


CELL = Cell(
    "eye",
    {"eye": Robot("eye"), "hand": Robot("hand")},
    cameras={"wrist": CellCamera("wrist", "eye"), "top": CellCamera("top", "world")},
    targets={"led": CellTarget("led", "hand", target=led_target([[0, 0, 0], [0.05, 0.02, 0]]))},
)
BASE, FAR = SE3.identity(), SE3(np.eye(3), np.array([0.0, 1.0, 0.0]))
SIGMAS_M = np.array([1e-3, 2e-3, 3e-3])


def by_hand(*numbers: int, **fields: object) -> tuple[list[Sample], Calibration]:
    """Samples whose flanges are 0.5 m above their bases, a metre apart, and their calibration."""
    up = RobotState(base_from_flange=SE3(np.eye(3), np.array([0.0, 0.0, 0.5])))
    samples = [Sample(k, robots={"eye": up, "hand": up}) for k in numbers]
    exact = PoseEstimate(BASE, np.zeros((6, 6)))
    known = {
        "eye_base_from_hand_base": PoseEstimate(FAR, np.diag([*SIGMAS_M**2, 0, 0, 0])),
        "eye_flange_from_wrist": exact,
        "hand_flange_from_led": exact,
    }
    return samples, Calibration("good", transforms=known, **fields)


def test_up_to_four_hundred_samples_are_all_shown():
    """Every second one of 401."""
    for count, shown in ((400, 400), (401, 201), (1, 1)):
        samples, calibration = by_hand(*range(count))
        drawn = scene(CELL, samples, calibration)
        assert (len(drawn.samples), drawn.total, drawn.opening) == (shown, count, 0)


def test_what_has_no_pose_is_named_as_missing():
    """A camera in the world without a transform; a robot without a base, and what it carries."""
    samples, calibration = by_hand(0)
    drawn = scene(CELL, samples, calibration)
    assert drawn.missing == ("top",)
    assert [body.name for body in drawn.bodies] == ["wrist", "led"]
    lacking = {name: pose for name, pose in calibration.transforms.items() if "hand_base" not in name}
    drawn = scene(CELL, samples, replace(calibration, transforms=lacking))
    assert drawn.missing == ("hand", "top", "led")
    assert [arm.name for arm in drawn.arms] == ["eye"]


def test_the_size_is_the_diagonal_of_what_arms_reach():
    """Bases a metre apart and flanges 0.5 m above them; a cell of one point has 0.2 m."""
    samples, calibration = by_hand(0)
    assert scene(CELL, samples, calibration).size_m == pytest.approx(1.25**0.5)
    alone = Cell("eye", {"eye": Robot("eye")})
    drawn = scene(alone, [Sample(0)], Calibration("good"))
    assert drawn.size_m == 0.2
    assert drawn.arms[0].world_from_flange(0) is None


def test_the_view_is_from_beside_the_farthest_base():
    """Right is towards it, rotated by 0.4 rad."""
    samples, calibration = by_hand(0)
    np.testing.assert_allclose(scene(CELL, samples, calibration).across, [-np.sin(0.4), np.cos(0.4), 0], atol=1e-12)


def test_ellipsoids_are_enlarged_until_they_are_seen():
    """By a round factor that keeps the longest at about a thirtieth of the scene; axes are right-handed."""
    samples, calibration = by_hand(0)
    drawn = scene(CELL, samples, calibration)
    hand = next(arm for arm in drawn.arms if arm.name == "hand")
    assert drawn.ellipsoid_scale == 12.5
    np.testing.assert_allclose(np.linalg.norm(hand.ellipsoid, axis=0), 12.5 * SIGMAS_M)
    np.testing.assert_allclose(hand.ellipsoid @ hand.ellipsoid.T, np.diag((12.5 * SIGMAS_M) ** 2), atol=1e-12)
    assert np.linalg.det(hand.ellipsoid) > 0
    assert next(arm for arm in drawn.arms if arm.name == "eye").ellipsoid is None


@pytest.mark.parametrize(("sigma_m", "scale"), [(0.0, 1.0), (1.0, 1.0), (np.inf, 1.0), (0.01, 5.0)])
def test_ellipsoids_are_never_drawn_smaller_than_one_sigma(sigma_m, scale):
    """Nor is a transform of no or infinite sigma enlarged."""
    samples, calibration = by_hand(0)
    covariance = np.diag([sigma_m**2, 0, 0, 0, 0, 0])
    base = {**calibration.transforms, "eye_base_from_hand_base": PoseEstimate(FAR, covariance)}
    drawn = scene(CELL, samples, replace(calibration, transforms=base))
    assert drawn.ellipsoid_scale == scale
    assert (next(arm for arm in drawn.arms if arm.name == "hand").ellipsoid is None) == np.isinf(sigma_m)


def test_a_frustum_without_a_lens_is_a_typical_one():
    """Edges from the centre of a length, 0.8 wide and 0.6 high at distance one, and a loop of four."""
    for camera in (None, Camera("pinhole", np.array([900.0, 900.0, 640.0, 360.0]))):
        lines = frustum(camera, 0.5)
        assert lines.shape == (8, 2, 3)
        assert not lines[:4, 0].any()
        ends = lines[:4, 1]
        np.testing.assert_allclose(np.linalg.norm(ends, axis=1), 0.5)
        expected = [[-0.4, -0.3, 1], [0.4, -0.3, 1], [0.4, 0.3, 1], [-0.4, 0.3, 1]]
        np.testing.assert_allclose(ends / ends[:, 2:], expected)
        np.testing.assert_array_equal(lines[4:], np.stack([ends, ends[[1, 2, 3, 0]]], axis=1))


def test_outlines_are_boxes_about_points_or_tags():
    """Of a board without tags, its bounding box; of tags, a square each; two points have none."""
    grid = outline(chessboard_target((4, 3), 0.02))
    np.testing.assert_allclose(grid[:, 0], [[0, 0, 0], [0.06, 0, 0], [0.06, 0.04, 0], [0, 0.04, 0]], atol=1e-12)
    np.testing.assert_array_equal(grid[:, 1], grid[[1, 2, 3, 0], 0])
    tags = outline(apriltag_target("tag36h11", [(3, 0.08, SE3.identity()), (4, 0.04, FAR)]))
    assert tags.shape == (8, 2, 3)
    np.testing.assert_allclose(np.linalg.norm(tags[:, 1] - tags[:, 0], axis=1), [0.08] * 4 + [0.04] * 4)
    assert outline(led_target([[0, 0, 0], [0.05, 0.02, 0]])).shape == (0, 2, 3)
    assert outline(led_target([[0, 0, 0], [0.05, 0.02, 0], [0, 0.03, 0]])).shape == (4, 2, 3)
    assert outline(None).shape == (0, 2, 3)


def test_data_are_rounded_to_hundredths_of_a_millimetre():
    """Poses are a translation and a quaternion; truth values stay."""
    samples, calibration = by_hand(0)
    third = SE3(np.eye(3), np.full(3, 1 / 3))
    base = {**calibration.transforms, "eye_base_from_hand_base": PoseEstimate(third, np.zeros((6, 6)))}
    arm = scene_data(scene(CELL, samples, replace(calibration, transforms=base)))["arms"][1]
    assert arm["world_from_base"] == [0.33333, 0.33333, 0.33333, 0, 0, 0, 1]
    assert arm["known"] == [True]
    assert worst_words(ErrorMap(np.zeros((1, 3)), np.array([2.34e-3]), np.zeros(1))) == "worst place: 2.3 mm"
