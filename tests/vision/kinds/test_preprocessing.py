"""Ways to search an image."""

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
def test_places_are_those_of_the_image(preprocessing: Preprocessing) -> None:
    """A bright spot in the image as a way shows it has its place in the image itself, to half a pixel."""
    y, x = np.mgrid[:120, :160]
    image = (20 + 60 * np.exp(-((x - 70.3) ** 2 + (y - 41.8) ** 2) / 50)).astype(np.uint8)
    shown = preprocessing.apply(image).astype(float)
    weight = np.where(shown > shown.max() * 0.8, shown, 0.0)
    rows, columns = np.mgrid[: shown.shape[0], : shown.shape[1]]
    middle = [(weight * each).sum() / weight.sum() for each in (columns, rows)]
    np.testing.assert_allclose(preprocessing.original_pixels(middle), [[70.3, 41.8]], atol=0.5)


def test_stretched_uses_all_levels() -> None:
    """Of a dark image the darkest level becomes black and the brightest white, whatever a few pixels are."""
    image = np.random.default_rng(0).integers(4, 14, (100, 100)).astype(np.uint8)
    image[0, :3] = 255
    shown = Preprocessing(stretched=True).apply(image)
    assert (np.median(shown[image == 4]), np.median(shown[image == 13])) == (0, 255)
    assert Preprocessing(stretched=True).apply(np.full((50, 50), 7, np.uint8)).std() == 0


def test_sizes_that_suit() -> None:
    """Nothing is searched in less than 16 pixels, and nothing large is enlarged."""
    small, large = np.zeros((20, 30), np.uint8), np.zeros((2000, 3000), np.uint8)
    assert Preprocessing().suits(small)
    assert not Preprocessing(0.5).suits(small)
    assert Preprocessing(2.0).suits(small)
    assert Preprocessing(0.5).suits(large)
    assert not Preprocessing(2.0).suits(large)


@pytest.mark.parametrize(
    ("counts", "tried", "found"), [([5, 9], 1, 5), ([2, 3, 1], 3, 3), ([0, 1, 0], 3, 1), ([0, 0, 0], 3, None)]
)
def test_best_of_several(counts: list[int], tried: int, found: int | None) -> None:
    """The first way that finds enough ends the search; else the one that found most counts."""
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
    """Every name that a cell may have gives a dictionary, and each set is of names that a cell may have."""
    assert all(len(dictionary(name).bytesList) for name in DICTIONARIES)
    surveyed = {name for names in MARKER_SETS for name in names}
    assert surveyed - {"tag16h5", "tag25h9", "tag36h10", "tag36h11"} <= set(DICTIONARIES)


@pytest.mark.parametrize("names", [names for names in MARKER_SETS if len(names) > 1], ids=lambda names: names[0])
def test_sets_begin_alike(names: tuple[str, ...]) -> None:
    """The smaller dictionaries of a set are the beginning of its largest."""
    largest = dictionary(names[-1]).bytesList
    sizes = [len(dictionary(name).bytesList) for name in names]
    assert sizes == sorted(sizes)
    for name, size in zip(names, sizes, strict=True):
        np.testing.assert_array_equal(dictionary(name).bytesList, largest[:size])


@pytest.mark.parametrize("border", [1, 2])
def test_cells_are_read_back(border: int) -> None:
    """A marker drawn from its black cells is read as itself, and its border is black all round."""
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


def test_names_and_numbers_that_are_none() -> None:
    """An unknown family, a marker beyond its dictionary and a board that needs more markers are named errors."""
    with pytest.raises(InputError, match="'tagCircle21h7' can be neither drawn nor detected"):
        dictionary("tagCircle21h7")
    with pytest.raises(InputError, match="DICT_4X4_50 has markers 0 to 49, not 50"):
        black_cells("DICT_4X4_50", 50)
    with pytest.raises(InputError, match="a 10x14 board needs 70: write `dictionary: DICT_4X4_100`"):
        charuco_board(charuco_target((10, 14), 0.04, 0.03, "DICT_4X4_50"))
    with pytest.raises(InputError, match=r"a 10x14 board needs 70$"):
        charuco_board(charuco_target((10, 14), 0.04, 0.03, "DICT_APRILTAG_25h9"))


def test_corners_of_markers() -> None:
    """Markers of a board are squares of their size, in the middle of the squares of the board."""
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
def test_sizes_that_just_suit(preprocessing: Preprocessing, shape: tuple[int, int], suits: bool) -> None:
    """Sixteen pixels after the change of scale; an image that is not enlarged may have any size."""
    assert preprocessing.suits(np.zeros(shape, np.uint8)) == suits


def test_enlarged_images_have_a_largest_size() -> None:
    """It is the same for wide and high ones."""
    sides = [side for side in range(500, 5000, 100) if Preprocessing(2.0).suits(np.zeros((side, side // 2), np.uint8))]
    assert sides == [
        side for side in range(500, 5000, 100) if Preprocessing(2.0).suits(np.zeros((side // 2, side), np.uint8))
    ]
    assert 1000 < max(sides) < 4900


def test_levels_are_stretched_evenly() -> None:
    """A level halfway between the darkest and the brightest is grey; one that is outside is clipped."""
    image = np.zeros((96, 96), np.uint8)
    image[:, :48], image[:, 48:] = 40, 60
    image[40:42] = 50
    image[44, :2] = 0, 255
    shown = Preprocessing(stretched=True).apply(image)
    assert (shown[0, 0], shown[0, 95], shown[44, 0], shown[44, 1]) == (0, 255, 0, 255)
    assert abs(int(shown[40, 10]) - 127) <= 1


def test_sharpening_steepens_edges() -> None:
    """Levels beside an edge go beyond those far from it, by less than their step; flat areas stay."""
    image = np.full((60, 60), 100, np.uint8)
    image[:, 30:] = 140
    shown = Preprocessing(sharpened=True).apply(image).astype(int)
    assert (shown[30, 2], shown[30, 57]) == (100, 140)
    assert 60 <= shown.min() < 95
    assert 145 < shown.max() <= 180


def test_an_equal_result_does_not_replace_an_earlier_one() -> None:
    """And one that is just enough ends the search."""
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
