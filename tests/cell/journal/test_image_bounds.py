"""Pixels outside the image they are said to be in."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.cell import Cell, CellCamera, Intrinsics, Robot
from basecal.cell.journal.image_bounds import check_image_bounds
from basecal.cell.recording import PixelObservation, Sample
from basecal.errors import DatasetError
from basecal.geometry import Camera

LENS = Camera("pinhole", np.array([900.0, 900, 640, 360]))


def cell(size_px: tuple[int, int] | None, lens: Camera | None = LENS) -> Cell:
    intrinsics = None if lens is None else Intrinsics("fixed", lens)
    camera = CellCamera("wrist", "eye", size_px=size_px, intrinsics=intrinsics)
    return Cell("eye", {"eye": Robot("eye")}, cameras={"wrist": camera})


def samples(scale: np.ndarray, count: int = 5, points: int = 40, swapped: bool = False) -> list[Sample]:
    """Views of points all over an image of 1280 x 720, scaled."""
    pixels = np.random.default_rng(0).uniform(0, 1, (count, points, 2)) * [1279, 719] * scale
    pixels = pixels[..., ::-1] if swapped else pixels
    ids = np.arange(points)
    return [Sample(n, observations=(PixelObservation("wrist", "board", ids, view),)) for n, view in enumerate(pixels)]


def check(size_px: tuple[int, int] | None, recorded: list[Sample], lens: Camera | None = LENS) -> None:
    check_image_bounds(recorded, {s.sample: s.sample + 1 for s in recorded}, "samples.jsonl", cell(size_px, lens))


def test_points_inside_are_taken():
    """All over the image, just outside by noise, and where no size is stated."""
    check((1280, 720), samples(np.ones(2)))
    check((1280, 720), samples(np.array([1.04, 1.04])))
    check(None, samples(np.full(2, 9.0)))
    check((1280, 720), [])


def test_a_few_stray_points_are_left_to_the_search_for_outliers():
    """One in twenty may be anywhere."""
    recorded = samples(np.ones(2))
    pixels = recorded[3].observations[0].pixels
    pixels[:9] = 9000.0
    check((1280, 720), recorded)
    pixels[:11] = 9000.0
    with pytest.raises(DatasetError, match=r"^samples\.jsonl:4: observations: 11 of 200 pixels of 'wrist' lie outside"):
        check((1280, 720), recorded)


@pytest.mark.parametrize(
    ("size_px", "lens", "scale", "swapped", "message"),
    [
        ((720, 1280), LENS, 1.0, False, r"width and height look swapped, expected size_px: \[1280, 720\]"),
        ((1280, 720), LENS, 1.0, True, "u and v of the points look swapped"),
        ((640, 360), LENS, 1.0, False, r"they reach to \(1\d\d\d, 7\d\d\): size_px is of another resolution"),
        ((1280, 720), LENS, 1.5, False, "size_px is of another resolution"),
        ((700, 700), LENS, 1.0, False, "size_px is of another resolution"),
    ],
)
def test_the_cause_is_named(size_px, lens, scale, swapped, message):
    """Sides swapped, coordinates swapped, another resolution."""
    with pytest.raises(DatasetError, match=message):
        check(size_px, samples(np.full(2, scale), swapped=swapped), lens)


@pytest.mark.parametrize(
    ("place", "is_inside"),
    [
        ((-63.9, 10.0), True),
        ((-64.1, 10.0), False),
        ((10.0, -63.9), True),
        ((10.0, -64.1), False),
        ((1342.9, 10.0), True),
        ((1343.1, 10.0), False),
        ((10.0, 782.9), True),
        ((10.0, 783.1), False),
    ],
)
def test_a_twentieth_of_the_width_may_be_missing_at_every_border(place, is_inside):
    """64 px of 1280, from the centres of the pixels at the border; the first sample outside is named by its line."""
    inside = np.full((20, 2), 100.0)
    views = [inside, np.tile(place, (20, 1)), np.full((20, 2), 9000.0)]
    recorded = [
        Sample(n, observations=(PixelObservation("wrist", "board", np.arange(20), view),))
        for n, view in enumerate(views[:2] if is_inside else views)
    ]
    if is_inside:
        check((1280, 720), recorded)
        return
    said = r":2: observations: 40 of 60 pixels of 'wrist' lie outside its 1280 x 720 px; they reach to \(9000, 9000\):"
    with pytest.raises(DatasetError, match=said):
        check((1280, 720), recorded)


def test_sides_look_swapped_without_a_lens_too():
    """What a principal point would tell is left out."""
    with pytest.raises(DatasetError, match=r"width and height look swapped, expected size_px: \[1280, 720\]$"):
        check((720, 1280), samples(np.ones(2)), None)
