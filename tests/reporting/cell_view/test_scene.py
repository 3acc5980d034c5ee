"""Tests of the scene: its initial sample, its bodies, and arms with their URDF."""

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


@pytest.mark.journey
def test_scene_opens_at_the_worst_sample():
    """Only some of many samples are shown, always including the worst."""
    made = simulate(Scenario(samples=6), 0)
    calibration = calibrate(made.cell, made.recording)
    samples = [replace(made.recording.samples[k % 6], sample=k) for k in range(1000)]
    views = tuple(SampleResidual(k, "wrist", "board", 0.2 + (k == 701)) for k in range(1000))
    drawn = scene(made.cell, samples, replace(calibration, residuals=Residuals(per_sample=views)))
    assert drawn.samples[drawn.opening] == 701
    assert len(drawn.samples) <= 401
    assert "reprojection error 1.2 px" in drawn.labels[drawn.opening]


def test_scene_opens_at_first_without_residuals():
    """The scene of a calibration without residuals opens at the first sample."""
    made = simulate(Scenario(samples=3), 0)
    calibration = replace(calibrate(made.cell, made.recording), residuals=Residuals())
    assert scene(made.cell, made.recording.samples, calibration).opening == 0


@pytest.mark.journey
def test_frustum_follows_the_lens():
    """The rays of the frustum project to the corners of the image, by the stated lens if none was estimated."""
    made = simulate(Scenario(samples=4), 0)
    drawn = scene(made.cell, made.recording.samples, calibrate(made.cell, made.recording))
    (camera,) = (body for body in drawn.bodies if body.kind == "camera")
    corners = made.cell.cameras["wrist"].intrinsics.camera.project(camera.lines[:4, 1])
    np.testing.assert_allclose(np.sort(corners, axis=0), [[0, 0], [0, 0], [1279, 719], [1279, 719]], atol=0.1)


@pytest.mark.journey
def test_arm_is_drawn_by_its_joints():
    """The joint positions lead from the base to the flange; a robot with recorded poses has none."""
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


@pytest.mark.journey
def test_sample_without_joints_hides_its_arm():
    """The arm has zero joints in this sample and is marked as unknown."""
    made = simulate(Scenario(samples=5, joints=True), 0)
    calibration = calibrate(made.cell, made.recording)
    first, *others = made.recording.samples
    lacking = replace(first, robots={"eye": first.robots["eye"]})
    drawn = scene(made.cell, [lacking, *others], calibration)
    hand = next(arm for arm in drawn.arms if arm.name == "hand")
    assert hand.known.tolist() == [False, True, True, True, True]
    assert hand.joints.translation.shape == (5, 6, 3)


@pytest.mark.journey
def test_link_bodies_require_all_meshes(tmp_path):
    """Surfaces are drawn with complete poses of the joints. If a mesh is missing, only joint positions are drawn."""
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


@pytest.mark.journey
def test_largest_error_is_labelled():
    """The data of the script and the still image have the largest error with its position."""
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


def test_up_to_400_samples_are_shown():
    """Every second of 401 samples is shown."""
    for count, shown in ((400, 400), (401, 201), (1, 1)):
        samples, calibration = by_hand(*range(count))
        drawn = scene(CELL, samples, calibration)
        assert (len(drawn.samples), drawn.total, drawn.opening) == (shown, count, 0)


def test_bodies_without_pose_are_listed_as_missing():
    """A camera on the world without a transform is listed as missing.

    So is a robot without a base, with all that it carries.
    """
    samples, calibration = by_hand(0)
    drawn = scene(CELL, samples, calibration)
    assert drawn.missing == ("top",)
    assert [body.name for body in drawn.bodies] == ["wrist", "led"]
    lacking = {name: pose for name, pose in calibration.transforms.items() if "hand_base" not in name}
    drawn = scene(CELL, samples, replace(calibration, transforms=lacking))
    assert drawn.missing == ("hand", "top", "led")
    assert [arm.name for arm in drawn.arms] == ["eye"]


def test_scene_size_is_diagonal_of_arms():
    """The bases are a metre apart and the flanges 0.5 m above them. A cell of a single point has 0.2 m."""
    samples, calibration = by_hand(0)
    assert scene(CELL, samples, calibration).size_m == pytest.approx(1.25**0.5)
    alone = Cell("eye", {"eye": Robot("eye")})
    drawn = scene(alone, [Sample(0)], Calibration("good"))
    assert drawn.size_m == 0.2
    assert drawn.arms[0].world_from_flange(0) is None


def test_viewpoint_is_beside_the_farthest_base():
    """The right of the view is the direction to the farthest base, rotated by 0.4 rad."""
    samples, calibration = by_hand(0)
    np.testing.assert_allclose(scene(CELL, samples, calibration).across, [-np.sin(0.4), np.cos(0.4), 0], atol=1e-12)


def test_ellipsoids_are_enlarged_to_be_visible():
    """The round factor makes the longest axis about a thirtieth of the scene. The axes are right-handed."""
    samples, calibration = by_hand(0)
    drawn = scene(CELL, samples, calibration)
    hand = next(arm for arm in drawn.arms if arm.name == "hand")
    assert drawn.ellipsoid_scale == 12.5
    np.testing.assert_allclose(np.linalg.norm(hand.ellipsoid, axis=0), 12.5 * SIGMAS_M)
    np.testing.assert_allclose(hand.ellipsoid @ hand.ellipsoid.T, np.diag((12.5 * SIGMAS_M) ** 2), atol=1e-12)
    assert np.linalg.det(hand.ellipsoid) > 0
    assert next(arm for arm in drawn.arms if arm.name == "eye").ellipsoid is None


@pytest.mark.parametrize(("sigma_m", "scale"), [(0.0, 1.0), (1.0, 1.0), (np.inf, 1.0), (0.01, 5.0)])
def test_ellipsoid_scale_is_at_least_one(sigma_m, scale):
    """A transform with a sigma of zero or infinity is not enlarged."""
    samples, calibration = by_hand(0)
    covariance = np.diag([sigma_m**2, 0, 0, 0, 0, 0])
    base = {**calibration.transforms, "eye_base_from_hand_base": PoseEstimate(FAR, covariance)}
    drawn = scene(CELL, samples, replace(calibration, transforms=base))
    assert drawn.ellipsoid_scale == scale
    assert (next(arm for arm in drawn.arms if arm.name == "hand").ellipsoid is None) == np.isinf(sigma_m)


def test_frustum_without_lens_has_default_shape():
    """A frustum without a lens is 0.8 wide and 0.6 high at distance one.

    Its edges from the centre have equal lengths, and a loop of four closes them.
    """
    for camera in (None, Camera("pinhole", np.array([900.0, 900.0, 640.0, 360.0]))):
        lines = frustum(camera, 0.5)
        assert lines.shape == (8, 2, 3)
        assert not lines[:4, 0].any()
        ends = lines[:4, 1]
        np.testing.assert_allclose(np.linalg.norm(ends, axis=1), 0.5)
        expected = [[-0.4, -0.3, 1], [0.4, -0.3, 1], [0.4, 0.3, 1], [-0.4, 0.3, 1]]
        np.testing.assert_allclose(ends / ends[:, 2:], expected)
        np.testing.assert_array_equal(lines[4:], np.stack([ends, ends[[1, 2, 3, 0]]], axis=1))


def test_outlines_enclose_points_or_tags():
    """A board without tags has its bounding box, each tag a square, and two points have none."""
    grid = outline(chessboard_target((4, 3), 0.02))
    np.testing.assert_allclose(grid[:, 0], [[0, 0, 0], [0.06, 0, 0], [0.06, 0.04, 0], [0, 0.04, 0]], atol=1e-12)
    np.testing.assert_array_equal(grid[:, 1], grid[[1, 2, 3, 0], 0])
    tags = outline(apriltag_target("tag36h11", [(3, 0.08, SE3.identity()), (4, 0.04, FAR)]))
    assert tags.shape == (8, 2, 3)
    np.testing.assert_allclose(np.linalg.norm(tags[:, 1] - tags[:, 0], axis=1), [0.08] * 4 + [0.04] * 4)
    assert outline(led_target([[0, 0, 0], [0.05, 0.02, 0]])).shape == (0, 2, 3)
    assert outline(led_target([[0, 0, 0], [0.05, 0.02, 0], [0, 0.03, 0]])).shape == (4, 2, 3)
    assert outline(None).shape == (0, 2, 3)


def test_scene_data_is_rounded_to_0_01_mm():
    """Poses are a translation and a quaternion; truth values are kept."""
    samples, calibration = by_hand(0)
    third = SE3(np.eye(3), np.full(3, 1 / 3))
    base = {**calibration.transforms, "eye_base_from_hand_base": PoseEstimate(third, np.zeros((6, 6)))}
    arm = scene_data(scene(CELL, samples, replace(calibration, transforms=base)))["arms"][1]
    assert arm["world_from_base"] == [0.33333, 0.33333, 0.33333, 0, 0, 0, 1]
    assert arm["known"] == [True]
    assert worst_words(ErrorMap(np.zeros((1, 3)), np.array([2.34e-3]), np.zeros(1))) == "worst place: 2.3 mm"
