"""Tests of printing targets into images of their surroundings."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.targets.charuco import charuco_target
from basecal.errors import InputError
from basecal.geometry import SE3, Camera
from basecal.vision.detectors import find_target
from basecal.vision.draw.backdrop import Backdrop, print_targets, undistorted_camera
from basecal.vision.draw.render import RenderSettings, expose

LENS = Camera("pinhole", np.array([500.0, 490.0, 322.0, 236.0, -0.2, 0.08, 0.001, -0.001, 0.0]), (640, 480))
BOARD = charuco_target((5, 7), 0.04, 0.03, "DICT_4X4_50")
POSE = SE3.from_rpy([0.2, -0.3, 0.1], [-0.1, -0.12, 0.6])
SOFT = RenderSettings(noise=0.5)


def backdrop(paper=1.0, level=200.0):
    return Backdrop(np.full((480, 640), level, np.float32), np.full((480, 640), paper, np.float32))


def test_backdrop_is_resampled_by_the_lens():
    """A ramp drawn without a lens is sampled at the ray of each pixel of the lens."""
    flat = undistorted_camera(LENS)
    width, height = flat.size_px
    ramp = np.linspace(0, 255, width)
    colours = np.broadcast_to(np.rint(ramp).astype(np.uint8)[None, :, None], (height, width, 3))
    pixels = np.array([[20.0, 30.0], [320.0, 240.0], [600.0, 460.0]])
    rays, _ = LENS.undistort(pixels)
    at = flat.focal_px * rays[:, 0] / rays[:, 2] + (width - 1) / 2
    levels = flat.backdrop(colours).levels
    assert np.allclose([levels[int(v), int(u)] for u, v in pixels], np.interp(at, np.arange(width), ramp), atol=0.6)


def test_paper_is_recognised_by_its_colour():
    """Grey is no paper, whatever its brightness. A colour without blue is all paper, and black is none."""
    flat = undistorted_camera(Camera("pinhole", np.array([50.0, 50.0, 31.5, 31.5]), (64, 64)))
    colours = np.zeros((flat.size_px[1], flat.size_px[0], 3), dtype=np.uint8)
    colours[:, :20] = 77
    colours[:, 40:] = [180, 180, 0]
    paper = flat.backdrop(colours).paper[32]
    assert np.all(paper[:15] == 0)
    assert np.all(paper[24:34] == 0)
    assert np.all(paper[45:] == 1)


def test_print_on_paper_is_detected():
    """Corners of a board on a backdrop that is all paper are detected within a tenth of a pixel."""
    image = expose(print_targets(LENS, [(BOARD, POSE)], backdrop(), SOFT), SOFT)
    found = find_target(image, BOARD)
    true = LENS.project(POSE @ BOARD.points)[BOARD.rows(found.ids)]
    assert len(found.ids) == len(BOARD.ids)
    assert np.abs(found.pixels - true).max() < 0.1


def test_targets_are_printed_only_on_paper():
    """The backdrop is unchanged if the paper is hidden, and half hidden pixels are half as dark."""
    bare, half, whole = (print_targets(LENS, [(BOARD, POSE)], backdrop(share), SOFT) for share in (0.0, 0.5, 1.0))
    assert np.allclose(bare, 200.0, atol=1e-3)
    assert np.allclose(half, (bare + whole) / 2, atol=1e-3)
    assert whole.min() == pytest.approx(200 * SOFT.black / SOFT.white, abs=2)


def test_too_wide_lens_is_refused():
    """A fisheye of 180 degrees has no undistorted image."""
    lens = Camera("fisheye", np.array([200.0, 200.0, 319.5, 239.5, 0.0, 0.0, 0.0, 0.0]), (640, 480))
    with pytest.raises(InputError, match="field of view of the lens is too wide"):
        undistorted_camera(lens)


def small(fx, fy, cx, cy, size=(64, 48)):
    return undistorted_camera(Camera("pinhole", np.array([fx, fy, cx, cy]), size))


def test_undistorted_image_is_symmetric():
    """Its size is twice the distance from the principal point to the farthest side, and a pixel more."""
    assert small(50.0, 50.0, 30.5, 25.5).size_px == (2 * 33 + 2, 2 * 26 + 2)
    assert small(50.0, 50.0, 33.5, 20.5).size_px == (2 * 34 + 2, 2 * 27 + 2)


def test_undistorted_pixels_are_about_the_centre():
    """Both axes of the undistorted image have the mean focal length."""
    flat = small(50.0, 54.0, 30.0, 26.0)
    assert flat.focal_px == 52
    middle = (np.array(flat.size_px) - 1) / 2
    assert flat.u.shape == (48, 64)
    np.testing.assert_allclose(flat.u[7], middle[0] + 52 * (np.arange(64) - 30) / 50, atol=1e-4)
    np.testing.assert_allclose(flat.v[:, 7], middle[1] + 52 * (np.arange(48) - 26) / 54, atol=1e-4)


@pytest.mark.parametrize("axis", [0, 1])
def test_undistorted_image_has_maximal_size(axis):
    """The undistorted image is at most 2.5 times as large along each axis: 158 px for 64 are accepted, 160 are not."""
    for off, drawn in ((77.5, True), (78.5, False)):
        centre = np.full(2, 31.5)
        centre[axis] = 63 - off
        if drawn:
            assert small(50.0, 50.0, *centre, size=(64, 64)).size_px[axis] == 158
        else:
            with pytest.raises(InputError, match="too wide"):
                small(50.0, 50.0, *centre, size=(64, 64))
