"""Tests of `basecal.hand_eye`, `basecal.robot_world` and `basecal.base_to_base`."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from tests.shared.stages import skipping

import basecal
from basecal.accuracy.arrays import functions
from basecal.accuracy.stages.solving import integrate_noise, screen_conventions
from basecal.cell import Calibration
from basecal.errors import InputError
from basecal.geometry import SE3, Array, PoseEstimate

X = SE3.exp([0.03, -0.05, 0.06, 0.2, -0.4, 0.3])
W = SE3.exp([0.5, 0.2, -0.3, 0.5, 1.0, -0.7])
Y = SE3.exp([1.2, 0.1, 0.0, 0.0, 0.1, 2.5])
CHANCE = np.random.default_rng(4)
SEEN = SE3.exp(np.c_[CHANCE.normal(0, 0.1, (14, 2)), CHANCE.normal(0.5, 0.1, 14), CHANCE.normal(0, 0.4, (14, 3))])


def _noisy(pose: SE3) -> SE3:
    sigma = np.repeat([2e-4, 4e-4], 3)
    return pose @ SE3.exp(CHANCE.normal(size=(len(pose), 6)) * sigma)


def _parts(pose: SE3) -> tuple[list[Array], list[Array]]:
    """Lists of arrays as OpenCV's users have them, translations as columns."""
    return list(pose.rotation), [place[:, None] for place in pose.translation]


def _within(estimate: PoseEstimate, true: SE3) -> bool:
    off = (estimate.mean.inverse() @ true).log()
    return (
        float(off @ np.linalg.solve(estimate.covariance, off)) < 30
    )  # chi-square with 6 freedoms, exceeded once in 25,000


@pytest.mark.journey
def test_hand_eye_matches_opencv() -> None:
    """Lists of arrays give OpenCV's result with a verdict and a covariance that contains the truth."""
    gripper = _parts(W @ SEEN.inverse() @ X.inverse())
    found = basecal.hand_eye(*gripper, *_parts(_noisy(SEEN)))
    assert found.verdict == "good"
    assert _within(found["cam2gripper"], X)
    assert _within(found["target2base"], W)
    theirs = cv2.calibrateHandEye(*gripper, *_parts(_noisy(SEEN)))
    np.testing.assert_allclose(found.t_cam2gripper, theirs[1], atol=2e-3)
    np.testing.assert_allclose(found.R_cam2gripper, theirs[0], atol=5e-3)
    assert repr(found).startswith("<good: cam2gripper [")
    assert "\n" not in repr(found)
    assert "GOOD" in found._repr_html_()


@pytest.mark.journey
@pytest.mark.parametrize(
    ("seed", "arm", "camera"),
    [
        *((seed, (2e-4, 3e-4), (1e-3, 4e-3)) for seed in (17, 102)),
        *((seed, (1e-3, 4e-3), (2e-4, 3e-4)) for seed in (71, 301, 395, 451)),
    ],
)
def test_only_gross_pose_is_left_out(seed: int, arm: tuple[float, float], camera: tuple[float, float]) -> None:
    """Clean draws lose no pose, whichever side has the noise [m, rad].

    Of twenty only the one off by 100 mm is left out.
    """
    rng = np.random.default_rng(seed)
    mount, world = (SE3.exp(np.r_[rng.normal(0, m, 3), rng.normal(0, rad, 3)]) for m, rad in ((0.05, 0.5), (0.5, 1)))
    places = np.c_[rng.normal(0, 0.1, (20, 2)), rng.normal(0.5, 0.1, 20)]
    sight = SE3.exp(np.c_[places, rng.normal(0, 0.35, (20, 3))])
    errors = [SE3.exp(rng.normal(size=(20, 6)) * np.repeat(sigma, 3)) for sigma in (arm, camera)]
    flange, seen = world @ sight.inverse() @ mount.inverse() @ errors[0], sight @ errors[1]
    off = np.zeros((20, 6))
    for culprits in (set[int](), {4}):
        off[list(culprits), 0] = 0.1
        gripper = flange @ SE3.exp(off)
        with skipping(screen_conventions, integrate_noise):
            found = basecal.hand_eye(gripper.rotation, gripper.translation, seen.rotation, seen.translation)
        assert {each.sample for each in found.calibration.outliers} == culprits


def test_rotation_vectors_of_still_camera_are_accepted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rotation vectors are accepted, and a still camera needs no inverted poses."""
    seen: list[tuple[SE3, SE3]] = []

    def solved(cell: basecal.Cell, recording: basecal.Recording, settings: basecal.Settings) -> Calibration:
        assert cell.transforms.keys() == {"hand_base_from_camera", "hand_flange_from_target"}
        state, view = recording.samples[3].robots["hand"], recording.samples[3].observations[0]
        seen.append((state.base_from_flange, view.camera_from_target))
        return Calibration("good", {name: PoseEstimate.exact(X) for name in cell.transforms})

    monkeypatch.setattr(functions, "calibrate", solved)
    moved = X @ SEEN
    found = basecal.hand_eye(
        moved.rotvec, moved.translation, SEEN.rotvec[..., None], SEEN.translation, camera_on="world"
    )
    np.testing.assert_allclose(seen[0][0].matrix, moved[3].matrix, atol=1e-12)
    np.testing.assert_allclose(seen[0][1].matrix, SEEN[3].matrix, atol=1e-12)
    np.testing.assert_allclose(found.t_cam2base[:, 0], X.translation)


def test_robot_world_matches_opencv(monkeypatch: pytest.MonkeyPatch) -> None:
    """Names and results are those of `calibrateRobotWorldHandEye`."""
    gripper_from_base = (W @ SEEN.inverse() @ X.inverse()).inverse()

    def solved(cell: basecal.Cell, recording: basecal.Recording, settings: basecal.Settings) -> Calibration:
        pose = recording.samples[0].robots["eye"].base_from_flange
        np.testing.assert_allclose(pose.matrix, gripper_from_base[0].inverse().matrix, atol=1e-9)
        exact = {"eye_flange_from_camera": PoseEstimate.exact(X), "eye_base_from_target": PoseEstimate.exact(W)}
        return Calibration("good", exact)

    monkeypatch.setattr(functions, "calibrate", solved)
    given = (*_parts(SEEN), *_parts(gripper_from_base))
    found, theirs = basecal.robot_world(*given), cv2.calibrateRobotWorldHandEye(*given)
    for mine, other in zip(
        (found.R_base2world, found.t_base2world, found.R_gripper2cam, found.t_gripper2cam), theirs, strict=True
    ):
        np.testing.assert_allclose(mine, other, atol=1e-6)


@pytest.mark.slow  # both arms move: a calibration with all its checks
def test_base_to_base_calibrates_two_moving_arms() -> None:
    """Both arms move, which no OpenCV method supports."""
    eye = SE3.exp(CHANCE.normal(size=(20, 6)) * np.repeat([0.2, 0.5], 3))
    seen = SE3.exp(np.c_[CHANCE.normal(0, 0.1, (20, 2)), CHANCE.normal(0.5, 0.1, 20), CHANCE.normal(0, 0.4, (20, 3))])
    hand = Y.inverse() @ eye @ X @ seen @ W.inverse()
    found = basecal.base_to_base(*_parts(_noisy(eye)), *_parts(hand), *_parts(_noisy(seen)))
    assert found.verdict == "good"
    for name, true in (("hand_base2eye_base", Y), ("cam2eye_gripper", X), ("target2hand_gripper", W)):
        assert _within(found[name], true), name


def test_invalid_poses_are_refused_by_name() -> None:
    """Scaled rotations and arrays of other lengths are refused by their names at once."""
    rotations, places = SEEN.rotation, SEEN.translation
    with pytest.raises(InputError, match="R_gripper2base is not a rotation"):
        basecal.hand_eye(1.1 * rotations, places, rotations, places)
    with pytest.raises(InputError, match="R_gripper2base has 14, R_target2cam has 13"):
        basecal.hand_eye(rotations, places, rotations[1:], places[1:])


def test_unknown_camera_carrier_is_refused() -> None:
    """An unknown `camera_on` is refused; it once meant a camera on the world."""
    gripper = _parts(W @ SEEN.inverse() @ X.inverse())
    with pytest.raises(InputError, match=r"^camera_on is 'Robot'.*, expected one of: robot, world$"):
        basecal.hand_eye(*gripper, *_parts(SEEN), camera_on="Robot")  # type: ignore[arg-type]
