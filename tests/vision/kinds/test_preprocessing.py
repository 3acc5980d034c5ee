"""Tests of the preprocessing of images before a search, and of markers."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from basecal.cell.targets.charuco import charuco_target
from basecal.cell.targets.fiducials import DICTIONARIES
from basecal.errors import InputError
from basecal.vision.kinds.preprocessing import (
    MARKER_SETS,
    Grey,
    Preprocessing,
    best_result,
    black_cells,
    charuco_board,
    dictionary,
    marker_corners,
)
from vision_scenes import TARGETS


@pytest.mark.parametrize(
    "preprocessing",
    [Preprocessing(), Preprocessing(0.5), Preprocessing(2.0), Preprocessing(2.0, stretched=True, sharpened=True)],
)
def test_original_pixels_invert_preprocessing(preprocessing: Preprocessing) -> None:
    """The position of a bright spot in a preprocessed image maps to that in the original one, to half a pixel."""
    y, x = np.mgrid[:120, :160]
    image = (20 + 60 * np.exp(-((x - 70.3) ** 2 + (y - 41.8) ** 2) / 50)).astype(np.uint8)
    shown = preprocessing.apply(image).astype(float)
    weight = np.where(shown > shown.max() * 0.8, shown, 0.0)
    rows, columns = np.mgrid[: shown.shape[0], : shown.shape[1]]
    middle = [(weight * each).sum() / weight.sum() for each in (columns, rows)]
    np.testing.assert_allclose(preprocessing.original_pixels(middle), [[70.3, 41.8]], atol=0.5)


def test_stretching_uses_all_levels() -> None:
    """The darkest level of a dark image becomes black and the brightest white, irrespective of a few outliers."""
    image = np.random.default_rng(0).integers(4, 14, (100, 100)).astype(np.uint8)
    image[0, :3] = 255
    shown = Preprocessing(stretched=True).apply(image)
    assert (np.median(shown[image == 4]), np.median(shown[image == 13])) == (0, 255)
    assert Preprocessing(stretched=True).apply(np.full((50, 50), 7, np.uint8)).std() == 0


def test_preprocessing_is_limited_by_image_size() -> None:
    """Images below 16 pixels are not searched, and large images are not enlarged."""
    small, large = np.zeros((20, 30), np.uint8), np.zeros((2000, 3000), np.uint8)
    assert Preprocessing().suits(small)
    assert not Preprocessing(0.5).suits(small)
    assert Preprocessing(2.0).suits(small)
    assert Preprocessing(0.5).suits(large)
    assert not Preprocessing(2.0).suits(large)


@pytest.mark.parametrize(
    ("counts", "tried", "found"), [([5, 9], 1, 5), ([2, 3, 1], 3, 3), ([0, 1, 0], 3, 1), ([0, 0, 0], 3, None)]
)
def test_search_ends_at_first_sufficient_result(counts: list[int], tried: int, found: int | None) -> None:
    """The first preprocessing with enough results ends the search; otherwise the one with most results is used."""
    calls: list[Preprocessing] = []

    def search(image: Grey, preprocessing: Preprocessing) -> list[int]:
        calls.append(preprocessing)
        return [0] * counts[len(calls) - 1]

    most = best_result(
        np.zeros((50, 50), np.uint8), [Preprocessing(), Preprocessing(0.5), Preprocessing(2.0)], search, 4
    )
    assert len(calls) == tried
    assert (None if most is None else len(most)) == found


def test_every_dictionary_is_known() -> None:
    """Every name that a cell may have gives a dictionary, and each marker set consists of such names."""
    assert all(len(dictionary(name).bytesList) for name in DICTIONARIES)
    surveyed = {name for names in MARKER_SETS for name in names}
    assert surveyed - {"tag16h5", "tag25h9", "tag36h10", "tag36h11"} <= set(DICTIONARIES)


@pytest.mark.parametrize("names", [names for names in MARKER_SETS if len(names) > 1], ids=lambda names: names[0])
def test_smaller_dictionaries_are_prefixes(names: tuple[str, ...]) -> None:
    """The smaller dictionaries of a set are the beginning of its largest."""
    largest = dictionary(names[-1]).bytesList
    sizes = [len(dictionary(name).bytesList) for name in names]
    assert sizes == sorted(sizes)
    for name, size in zip(names, sizes, strict=True):
        np.testing.assert_array_equal(dictionary(name).bytesList, largest[:size])


@pytest.mark.parametrize("border", [1, 2])
def test_drawn_marker_is_detected(border: int) -> None:
    """A marker drawn from its black cells is read as itself, and its border is black on all sides."""
    cells = black_cells("tag36h11", 7, border)
    assert cells.shape == (6 + 2 * border, 6 + 2 * border)
    assert cells[:border].all()
    assert cells[:, -border:].all()
    image = np.pad(np.where(np.kron(cells, np.ones((12, 12), bool)), 0, 255).astype(np.uint8), 40, constant_values=255)
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = border
    _, ids, _ = cv2.aruco.ArucoDetector(dictionary("tag36h11"), parameters).detectMarkers(image)
    assert ids is not None
    assert ids.ravel().tolist() == [7]


def test_unknown_names_and_numbers_are_refused() -> None:
    """An unknown family, a marker beyond its dictionary and a board that needs more markers are input errors."""
    with pytest.raises(InputError, match="'tagCircle21h7' can be neither drawn nor detected"):
        dictionary("tagCircle21h7")
    with pytest.raises(InputError, match="DICT_4X4_50 has markers 0 to 49, not 50"):
        black_cells("DICT_4X4_50", 50)
    with pytest.raises(InputError, match="a 10x14 board needs 70: write `dictionary: DICT_4X4_100`"):
        charuco_board(charuco_target((10, 14), 0.04, 0.03, "DICT_4X4_50"))
    with pytest.raises(InputError, match=r"a 10x14 board needs 70$"):
        charuco_board(charuco_target((10, 14), 0.04, 0.03, "DICT_APRILTAG_25h9"))


def test_marker_corners_are_centred_in_squares() -> None:
    """Markers of a board are squares of their size, centred in the squares of the board."""
    corners = marker_corners(TARGETS["charuco"])
    assert corners.shape == (17, 4, 2)
    np.testing.assert_allclose(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2), 0.03, atol=1e-7)
    np.testing.assert_allclose((corners.mean(axis=1) / 0.04) % 1, 0.5, atol=1e-5)


@pytest.mark.parametrize(
    ("preprocessing", "shape", "suits"),
    [
        (Preprocessing(), (16, 30), True),
        (Preprocessing(), (15, 30), False),
        (Preprocessing(), (30, 15), False),
        (Preprocessing(0.5), (32, 32), True),
        (Preprocessing(0.5), (30, 64), False),
        (Preprocessing(), (4000, 9000), True),
        (Preprocessing(2.0), (8, 8), True),
    ],
)
def test_size_limits_are_inclusive(preprocessing: Preprocessing, shape: tuple[int, int], suits: bool) -> None:
    """The limit is sixteen pixels after scaling. An image that is not enlarged may have any size."""
    assert preprocessing.suits(np.zeros(shape, np.uint8)) == suits


def test_enlarged_images_have_maximal_size() -> None:
    """The limit is the same for wide and high images."""
    sides = [side for side in range(500, 5000, 100) if Preprocessing(2.0).suits(np.zeros((side, side // 2), np.uint8))]
    assert sides == [
        side for side in range(500, 5000, 100) if Preprocessing(2.0).suits(np.zeros((side // 2, side), np.uint8))
    ]
    assert 1000 < max(sides) < 4900


def test_levels_are_stretched_linearly() -> None:
    """A level halfway between the darkest and the brightest becomes grey; one outside is clipped."""
    image = np.zeros((96, 96), np.uint8)
    image[:, :48], image[:, 48:] = 40, 60
    image[40:42] = 50
    image[44, :2] = 0, 255
    shown = Preprocessing(stretched=True).apply(image)
    assert (shown[0, 0], shown[0, 95], shown[44, 0], shown[44, 1]) == (0, 255, 0, 255)
    assert abs(int(shown[40, 10]) - 127) <= 1


def test_sharpening_steepens_edges() -> None:
    """Levels beside an edge overshoot those far from it by less than the step. Uniform areas are unchanged."""
    image = np.full((60, 60), 100, np.uint8)
    image[:, 30:] = 140
    shown = Preprocessing(sharpened=True).apply(image).astype(int)
    assert (shown[30, 2], shown[30, 57]) == (100, 140)
    assert 60 <= shown.min() < 95
    assert 145 < shown.max() <= 180


def test_equal_result_does_not_replace_earlier_one() -> None:
    """A result that is just sufficient ends the search."""
    counts = iter([2, 2, 3, 9])
    found = best_result(
        np.zeros((50, 50), np.uint8), [Preprocessing()] * 4, lambda image, preprocessing: [next(counts)] * 2, 3
    )
    assert found == [2, 2]
    assert list(counts) == []
    counts = iter([2, 3, 4])
    assert (
        best_result(
            np.zeros((50, 50), np.uint8), [Preprocessing()] * 3, lambda image, preprocessing: [0] * next(counts), 3
        )
        == [0] * 3
    )
