"""Tests of the survey that describes images without the stated target."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.special import ndtr

from basecal.cell.target import Target
from basecal.cell.targets.apriltag import apriltag_target
from basecal.cell.targets.charuco import charuco_target
from basecal.cell.targets.chessboard import chessboard_target
from basecal.cell.targets.circles import circles_target
from basecal.cell.targets.led import led_target
from basecal.geometry import SE3, Camera
from basecal.vision.detectors import describe_other_targets, find_target
from basecal.vision.draw.render import render
from basecal.vision.survey import _edge_px, _ids, _near_sizes, describe_blur, describe_darkness, describe_print_error
from quick import quick
from vision_scenes import STRAIGHT, TARGETS, scene, shrunk

LEANT = SE3.from_rpy((0.1, 0.1, -0.2), (0.0, 0.0, 0.55))


def tag(family: str, number: int) -> Target:
    return apriltag_target(family, [(number, 0.1, SE3.identity())])


CASES = {
    "another id": ("aruco", tag("DICT_6X6_250", 3), "tag 17 is there, not 3"),
    "other ids": ("tags", tag("tag36h11", 0), "tags 1, 4, 7, 10, 13, ... are there, not 0"),
    "another family": ("tags", tag("tag25h9", 0), "tag36h11 has 6 tags here"),
    "another family of one": ("aruco", tag("tag36h11", 0), "DICT_6X6_50 has tag 17 here"),
    "another dictionary": (
        "charuco",
        charuco_target((5, 7), 0.04, 0.03, "DICT_5X5_50"),
        "no board of DICT_5X5_50; DICT_4X4_50 has 17 markers here: write `dictionary: DICT_4X4_50`",
    ),
    "rows for columns": (
        "charuco",
        charuco_target((7, 5), 0.04, 0.03, "DICT_4X4_50"),
        "5x7 squares without legacy_pattern fit, not 7x5 squares without legacy_pattern: write `squares: [5, 7]`",
    ),
    "other squares": (
        "charuco",
        charuco_target((6, 8), 0.04, 0.03, "DICT_4X4_50"),
        "5x7 squares without legacy_pattern fit, not 6x8 squares without legacy_pattern: write `squares: [5, 7]`",
    ),
    "fewer squares": (
        "charuco",
        charuco_target((6, 5), 0.04, 0.03, "DICT_4X4_50"),
        "5x7 squares without legacy_pattern fit, not 6x5 squares without legacy_pattern: write `squares: [5, 7]`",
    ),
    "another pattern": (
        "legacy",
        charuco_target((5, 8), 0.035, 0.026, "DICT_5X5_100"),
        "5x8 squares with legacy_pattern fit, not 5x8 squares without legacy_pattern: write `legacy_pattern: true`",
    ),
    "corner too many": ("chessboard", chessboard_target((9, 7), 0.03), "9x6 inner corners are seen, not 9x7"),
    "squares for corners": ("chessboard", chessboard_target((10, 7), 0.03), "9x6 inner corners are seen, not 10x7"),
    "another board": ("chessboard", chessboard_target((12, 4), 0.03), "9x6 inner corners are seen, not 12x4"),
    "circles": (
        "circles",
        circles_target((9, 5), 0.03),
        "a symmetric grid of 8x5 circles fits, not a symmetric grid of 9x5",
    ),
    "fewer circles": (
        "circles",
        circles_target((7, 5), 0.03),
        "a symmetric grid of 8x5 circles fits, not a symmetric grid of 7x5",
    ),
    "asymmetric": (
        "asymmetric",
        circles_target((4, 11), 0.02),
        "an asymmetric grid of 4x11 circles fits, not a symmetric grid of 4x11",
    ),
}


LONG = {
    "another board", "corner too many", "squares for corners", "circles", "another pattern", "other squares",
    "fewer squares", "another family of one",
}  # fmt: skip


@pytest.mark.journey
@pytest.mark.parametrize("case", quick(CASES, CASES.keys() - LONG))
def test_visible_other_target_is_described(case: str) -> None:
    """The survey names the visible number, family, dictionary, layout or size if it differs from the stated one."""
    printed, stated, words = CASES[case]
    images = [shrunk(scene(TARGETS[printed], pose=pose), 2) for pose in (STRAIGHT, LEANT)]
    assert all(find_target(image, stated) is None for image in images)
    assert describe_other_targets(images, stated) == words


def test_marker_ids_beyond_board_are_listed() -> None:
    """If markers of the right dictionary give no corner, the survey lists their ids and those of the stated board."""
    far = apriltag_target("DICT_4X4_50", [(40 + k, 0.1, SE3(np.eye(3), np.array([0.15 * k, 0, 0]))) for k in range(2)])
    words = describe_other_targets([scene(far)], TARGETS["charuco"])
    assert words is not None
    assert words.startswith("markers 40, 41 of DICT_4X4_50 are there, the board stated has 0 to 16: count its squares")


@pytest.mark.parametrize("kind", quick(["chessboard", "circles"], ["chessboard"]))
def test_markers_on_stated_plain_board_are_reported(kind: str) -> None:
    """A board with markers is reported as another kind than the stated one."""
    images = [shrunk(scene(TARGETS["charuco"], pose=pose), 2) for pose in (STRAIGHT, LEANT)]
    words = describe_other_targets(images, TARGETS[kind])
    assert words is not None
    assert words.startswith("DICT_4X4_50 has 17 markers here: write kind: charuco")


@pytest.mark.journey
def test_print_error_names_unexpected_markers():
    """Unexpected markers are reported if the board is missed in some images, even if it was found in others."""
    images = [shrunk(scene(TARGETS["charuco"]), 2)]
    assert "write kind: charuco" in (describe_print_error(images, TARGETS["chessboard"]) or "")
    assert describe_print_error([shrunk(scene(TARGETS["chessboard"]), 2)], TARGETS["chessboard"]) is None
    assert describe_print_error(images, TARGETS["charuco"]) is None


@pytest.mark.parametrize("blur_px", [6.0, 12.0])
def test_blur_is_reported_with_its_width(blur_px: float) -> None:
    """The reported blur is accurate within a third. Readable blurred images and noise are not reported as blurred."""
    sharp = [scene(TARGETS["charuco"], pose=pose) for pose in (STRAIGHT, LEANT)]
    words = describe_blur([cv2.GaussianBlur(image, (0, 0), blur_px) for image in sharp])
    assert words is not None
    assert float(words.split("about ")[1].split()[0]) == pytest.approx(blur_px, rel=0.34)
    assert "look at focus" in words
    assert describe_blur(sharp) is None
    assert describe_blur([cv2.GaussianBlur(image, (0, 0), 2.5) for image in sharp]) is None


@pytest.mark.journey
@pytest.mark.parametrize("kind", list(TARGETS))
def test_clutter_gives_no_description(kind: str) -> None:
    """The survey describes no target in clutter, and reports only the darkness of a dark image."""
    specks = (gaussian_filter(np.random.default_rng(k).normal(0, 1, (120, 160)), 3.0) for k in range(2))
    clutter = [np.clip(128 + 800 * each, 0, 255).astype(np.uint8) for each in specks]
    assert describe_other_targets(clutter, TARGETS[kind]) is None
    dark = [image // 40 for image in clutter]
    words = describe_other_targets(dark, TARGETS[kind])
    assert words is not None
    assert words.startswith("the images are dark: 99 % of their pixels are below level 7 of 255; more light")


def test_leds_and_missing_images_give_no_description() -> None:
    """The survey has no description for LEDs, nor without images."""
    assert describe_other_targets([np.full((50, 50), 100, np.uint8)], led_target()) is None
    assert describe_other_targets([], TARGETS["tags"]) is None


def print_of(target: Target, x_m: float) -> SE3:
    """Pose of a frontal board, displaced to one side."""
    turn = SE3.from_rpy((np.pi, 0.1, 0.1), (0, 0, 0)).rotation @ np.diag([1, -1, -1.0])
    return SE3(turn, np.array([x_m, 0, 0.9]) - turn @ target.points.mean(0))


BOARD = charuco_target((5, 7), 0.04, 0.03, "DICT_4X4_50")
CAMERA = Camera("pinhole", np.array([600.0, 600.0, 319.5, 239.5, 0, 0, 0, 0, 0]), (640, 480))


def test_mirrored_images_are_reported() -> None:
    """Markers cannot be read in a mirrored image. The survey detects this by mirroring the image back."""
    image = render(CAMERA, BOARD, print_of(BOARD, 0.0), None, 1)
    mirrored = np.fliplr(image).copy()
    assert find_target(mirrored, BOARD) is None
    assert "the images are mirrored" in (describe_other_targets([mirrored], BOARD) or "")


@pytest.mark.journey
def test_second_print_of_board_is_reported() -> None:
    """Two boards with the same markers in one image are not detected as a board, and are reported."""
    both, other = (render(CAMERA, BOARD, print_of(BOARD, x), None, 1) for x in (0.17, -0.17))
    middle = both.shape[1] // 2
    both[:, :middle] = other[:, :middle]
    assert find_target(both, BOARD) is None
    assert "its markers are seen twice in one image" in (describe_other_targets([both], BOARD) or "")


@pytest.mark.journey
def test_charuco_board_is_not_a_chessboard() -> None:
    """A few corners of a ChArUco board that resemble a chessboard are no views, and its markers are reported."""
    image = render(CAMERA, BOARD, print_of(BOARD, 0.0), None, 1)
    described = chessboard_target((4, 6), 0.04)
    assert find_target(image, described) is None
    assert "DICT_4X4_50 has 17 markers here: write kind: charuco" in (describe_other_targets([image], described) or "")


@pytest.mark.journey
def test_single_marker_suggests_no_dictionary() -> None:
    """A single marker of another dictionary may be clutter."""
    image = render(CAMERA, tag("DICT_6X6_250", 3), SE3.from_rpy((np.pi, 0, 0), (0, 0, 0.6)), None, 1)
    assert "dictionary" not in (describe_other_targets([image, image], BOARD) or "")


@pytest.mark.parametrize(("level", "dark"), [(39, True), (40, False)])
def test_dark_images_are_reported(level: int, dark: bool) -> None:
    """Images are dark if 99 % of the pixels of the brightest are below level 40. A few bright pixels have no effect."""
    image = np.full((100, 100), level, np.uint8)
    image[0, :50] = 255
    words = describe_darkness([np.zeros((100, 100), np.uint8), image])
    assert (words is not None) == dark
    assert words is None or f"99 % of their pixels are below level {level + 1} of 255; more light" in words
    assert describe_darkness([]) is None


def edge(sigma_px: float, height: float = 150.0) -> np.ndarray:
    """A blurred step."""
    return np.rint(50 + height * ndtr((np.arange(200.0) - 100) / sigma_px))[None].repeat(120, 0).astype(np.uint8)


@pytest.mark.parametrize("sigma_px", [1.0, 2.0, 4.5, 8.0])
def test_blur_is_sigma_of_sharpest_edges(sigma_px: float) -> None:
    """The blur is accurate to a fifth of a pixel. It is None without contrast."""
    assert _edge_px(edge(sigma_px)) == pytest.approx(sigma_px, abs=0.2)
    assert _edge_px(edge(sigma_px, 39.0)) is None
    assert _edge_px(edge(sigma_px, 45.0)) is not None


def test_blur_requires_all_images_blurred() -> None:
    """Blur is reported only if all images are blurred, with the sigma of the sharpest.

    A sharp image or one without contrast prevents the report.
    """
    soft, softer, sharp = edge(5.0), edge(9.0), edge(1.0)
    words = describe_blur([soft, softer])
    assert words is not None
    assert "by about 5 px" in words
    assert describe_blur([softer, sharp]) is None
    assert describe_blur([softer, np.full((60, 60), 90, np.uint8)]) is None
    assert describe_blur([edge(3.7)]) is None
    assert describe_blur([]) is None


def test_at_most_five_ids_are_listed() -> None:
    """Ids are listed in ascending order, and more than five end with dots."""
    assert _ids({3, 1, 2, 5, 4}) == "1, 2, 3, 4, 5"
    assert _ids({3, 1, 2, 5, 4, 6}) == "1, 2, 3, 4, 5, ..."


def test_near_sizes_of_stated_board() -> None:
    """The tried sizes have one more in either or both directions, then one less."""
    assert _near_sizes(9, 6) == [(10, 6), (9, 7), (10, 7), (8, 6), (9, 5), (8, 5)]
