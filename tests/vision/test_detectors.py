"""Tests of targets detected in rendered images: their positions and sigmas."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from basecal.cell.target import Target
from basecal.cell.targets.apriltag import apriltag_target
from basecal.cell.targets.chessboard import chessboard_target
from basecal.cell.targets.led import led_target
from basecal.errors import InputError
from basecal.geometry import SE3, Array, Camera
from basecal.vision.detection import Detection
from basecal.vision.detectors import find_target
from basecal.vision.draw.render import RenderSettings, render
from quick import quick
from vision_scenes import FISHEYE, PLAIN, TARGETS, WIDE, poses

# 320 coordinates determine the ratio of errors to sigmas within 0.04; targets of few points have four images.
COORDINATES, MOST_IMAGES = 320, 4


@dataclass
class Errors:
    """Errors [px] and sigmas [px] of all points of some images, and the share of points found."""

    error: Array
    sigma: Array
    found: float

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def ratio(self) -> float:
        return float(np.sqrt(np.mean((self.error / self.sigma[:, None]) ** 2)))


def by_id(shape: Target, detection: Detection, true: Array) -> Array:
    """Errors of a detection, from the end of a symmetric grid at which it starts."""
    assert detection.ids is not None
    forth = detection.pixels - true[shape.rows(detection.ids)]
    if shape.kind != "circles" and not (shape.kind == "chessboard" and sum(shape.options["corners"]) % 2 == 0):
        return forth
    back = detection.pixels - true[::-1][shape.rows(detection.ids)]
    return min(forth, back, key=lambda each: float(np.abs(each).max()))


def errors(kind: str, camera: Camera, settings: RenderSettings, tilt: float = 0.6, seed: int = 0) -> Errors:
    shape = TARGETS[kind]
    error, sigma = [], []
    images = min(MOST_IMAGES, -(-COORDINATES // (2 * len(shape.ids))))
    for index, pose in enumerate(poses(shape, images, np.random.default_rng(seed), tilt)):
        detection = find_target(render(camera, shape, pose, settings, index), shape)
        if detection is not None:
            error.append(by_id(shape, detection, camera.project(pose @ shape.points)))
            sigma.append(detection.sigma_px)
    return Errors(np.concatenate(error), np.concatenate(sigma), len(np.concatenate(sigma)) / images / len(shape.ids))


@pytest.mark.journey
@pytest.mark.parametrize(
    ("kind", "camera"),
    [
        ("charuco", WIDE),
        ("legacy", FISHEYE),
        ("chessboard", WIDE),
        pytest.param("chessboard", FISHEYE, marks=pytest.mark.slow),
        ("tags", WIDE),
    ],
)
def test_corner_error_is_below_0_06_px(kind: str, camera: Camera) -> None:
    """With noise of two grey levels, corners have errors below 0.06 px rms, and more than 95 % are found."""
    seen = errors(kind, camera, RenderSettings(noise=2.0, blur_px=0.8))
    assert seen.rms < 0.06
    assert seen.found > 0.95


SHARP, USUAL, BLURRED, NOISY = ((1.0, 0.5), (1.0, 1.0), (2.0, 2.0), (8.0, 1.0))
QUICK = {"chessboard": (USUAL,), "tags": (NOISY,)}
IMAGES_OF = [
    pytest.param(kind, *image, marks=() if image in QUICK.get(kind, ()) else pytest.mark.slow)
    for kind in ("charuco", "chessboard", "tags", "circles", "asymmetric")
    for image in (SHARP, USUAL, BLURRED, NOISY)
]


@pytest.mark.journey
@pytest.mark.parametrize(("kind", "noise", "blur"), IMAGES_OF)
def test_corner_sigma_matches_error(kind: str, noise: float, blur: float) -> None:
    """The errors of corners agree with their sigmas within 20 %, whatever the noise, the blur and the tilt."""
    seen = errors(kind, WIDE, RenderSettings(noise=noise, blur_px=blur), tilt=0.8)
    assert 0.8 < seen.ratio < 1.2


@pytest.mark.journey
@pytest.mark.parametrize("kind", quick(["circles", "asymmetric"], ["circles"]))
def test_disc_centres_are_unbiased(kind: str) -> None:
    """Detected centres of circles are those of the discs, not of their elliptical images, within 0.005 px rms."""
    seen = errors(kind, WIDE, RenderSettings(noise=0.5))
    assert seen.rms < 0.005
    assert seen.found > 0.95


@pytest.mark.journey
def test_sigma_holds_in_sharpened_image() -> None:
    """Corner errors agree with their sigmas in an image that the camera has sharpened, as most cameras do."""
    shape, errors_of, sigma = TARGETS["charuco"], [], []
    for index, pose in enumerate(poses(shape, 3, np.random.default_rng(5))):
        plain = render(WIDE, shape, pose, RenderSettings(noise=1.0, black=60, white=160), index).astype(np.float64)
        sharp = np.clip(np.rint(plain + 1.0 * (plain - gaussian_filter(plain, 1.2))), 0, 255).astype(np.uint8)
        detection = find_target(sharp, shape)
        assert detection is not None
        errors_of.append(by_id(shape, detection, WIDE.project(pose @ shape.points)))
        sigma.append(detection.sigma_px)
    ratio = np.concatenate(errors_of) / np.concatenate(sigma)[:, None]
    assert np.concatenate(errors_of).std() < 0.03
    assert 0.7 < ratio.std() < 1.3  # sharpening also correlates the noise of neighbours


@pytest.mark.journey
@pytest.mark.parametrize("kind", quick(["charuco", "chessboard", "asymmetric", "tags"], ["charuco", "asymmetric"]))
def test_sixteen_bit_image_gives_same_detection(kind: str) -> None:
    """An image of 16 bits, or of 12 bits stored in 16, gives the detection of one of 8."""
    shape = TARGETS[kind]
    pose = poses(shape, 1, np.random.default_rng(4), tilt=0.3)[0]
    deep = render(WIDE, shape, pose, RenderSettings(bits=16))
    eight, sixteen, twelve = (find_target(each, shape) for each in ((deep // 257).astype(np.uint8), deep, deep // 16))
    assert eight is not None
    assert sixteen is not None
    assert twelve is not None
    np.testing.assert_allclose(sixteen.pixels, eight.pixels, atol=0.03)
    np.testing.assert_allclose(twelve.pixels, sixteen.pixels, atol=1e-3)


@pytest.mark.journey
@pytest.mark.parametrize("kind", list(TARGETS))
def test_no_target_is_found_in_noise(kind: str) -> None:
    """No target is found in noise, in a plain image or in one of a few pixels."""
    noise = np.random.default_rng(0).integers(0, 256, (240, 320)).astype(np.uint8)
    for image in (noise, np.full((200, 200), 255, np.uint8), np.zeros((3, 5), np.uint16)):
        assert find_target(image, TARGETS[kind]) is None


def test_partly_visible_charuco_is_detected() -> None:
    """The visible corners of a ChArUco board that leaves the image are found under their own ids."""
    shape = TARGETS["charuco"]
    pose = SE3(np.eye(3), np.array([-0.55, -0.14, 0.5]))
    true = WIDE.project(pose @ shape.points)
    detection = find_target(render(WIDE, shape, pose), shape)
    assert detection is not None
    assert detection.ids is not None
    assert 4 <= len(detection.ids) < len(shape.ids)
    np.testing.assert_allclose(detection.pixels, true[detection.ids], atol=0.1)


@pytest.mark.journey
def test_chessboard_ids_start_at_black_square() -> None:
    """If a half turn exchanges black and white, ids start at the corner whose outer square is black."""
    shape = TARGETS["chessboard"]
    for turn in (0.0, np.pi / 2, np.pi, 4.0):
        rotation = SE3.from_rpy((0.2, 0.1, turn), np.zeros(3)).rotation
        pose = SE3(rotation.copy(), np.array([0, 0, 0.5]) - rotation @ shape.points.mean(axis=0))
        detection = find_target(render(PLAIN, shape, pose), shape)
        assert detection is not None
        np.testing.assert_allclose(detection.pixels, PLAIN.project(pose @ shape.points), atol=0.1)


@pytest.mark.journey
def test_foreign_and_repeated_tags_are_excluded() -> None:
    """Tags that are not on the target, and a tag that appears twice, are excluded."""
    two = apriltag_target("tag36h11", [(k, 0.08, SE3(np.eye(3), np.array([0.12 * k, 0, 0]))) for k in (0, 1)])
    pose = SE3(np.eye(3), np.array([-0.05, 0.0, 0.5]))
    one = apriltag_target("tag36h11", [(1, 0.08, SE3.identity())])
    image = render(WIDE, two, pose)
    detection = find_target(image, one)
    assert detection is not None
    assert detection.ids is not None
    assert detection.ids.tolist() == [4, 5, 6, 7]
    assert find_target(np.concatenate([image, image]), one) is None


@pytest.mark.parametrize(
    ("shape", "image", "message"),
    [
        (TARGETS["tags"], np.zeros((20, 20, 3), np.uint8), "expected"),
        (TARGETS["tags"], np.zeros((20, 20), np.float32), "float32"),
        (chessboard_target((2, 5), 0.03), np.zeros((99, 99), np.uint8), "3 or more"),
        (apriltag_target("tagCustom48h12", [(0, 0.1, SE3.identity())]), np.zeros((99, 99), np.uint8), "tagCustom48h12"),
    ],
)
def test_unsupported_image_or_target_is_refused(shape: Target, image: Any, message: str) -> None:
    """An image that is not grey, and a target that cannot be detected, are input errors."""
    with pytest.raises(InputError, match=message):
        find_target(image, shape)


def test_tag_with_wide_border_is_detected() -> None:
    """A tag printed with two cells of border, as some programs do, is detected like one with one cell."""
    plain = apriltag_target("tag36h11", [(5, 0.1, SE3.identity())])
    (sheet,) = plain.sheets
    wide = replace(plain, sheets=(replace(sheet, markers=(replace(sheet.markers[0], border=2),)),))
    pose = SE3.from_rpy((0.1, 0.2, 0.3), (-0.02, 0.01, 0.5))
    detection = find_target(render(WIDE, wide, pose), plain)
    assert detection is not None
    np.testing.assert_allclose(detection.pixels, WIDE.project(pose @ plain.points), atol=0.1)


@pytest.mark.parametrize(("height", "found"), [(15, False), (16, True)])
def test_images_below_sixteen_rows_are_not_searched(height: int, found: bool) -> None:
    """OpenCV's detectors fail on fewer than 16 rows or columns. An LED is not searched in smaller images either."""
    rows, columns = np.indices((height, 24))
    image = np.rint(200 * np.exp(-0.5 * ((rows - 7.2) ** 2 + (columns - 11.6) ** 2) / 1.5**2)).astype(np.uint8)
    for each in (image, image.T.copy()):
        assert (find_target(each, led_target()) is not None) == found
