"""Ways to search an image."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.vision.kinds.ways import Grey, Way, best_result


@pytest.mark.parametrize("way", [Way(), Way(0.5), Way(2.0), Way(2.0, stretched=True, sharpened=True)])
def test_places_are_those_of_the_image(way: Way) -> None:
    """A bright spot in the image as a way shows it has its place in the image itself, to half a pixel."""
    y, x = np.mgrid[:120, :160]
    image = (20 + 60 * np.exp(-((x - 70.3) ** 2 + (y - 41.8) ** 2) / 50)).astype(np.uint8)
    shown = way.apply(image).astype(float)
    weight = np.where(shown > shown.max() * 0.8, shown, 0.0)
    rows, columns = np.mgrid[: shown.shape[0], : shown.shape[1]]
    middle = [(weight * each).sum() / weight.sum() for each in (columns, rows)]
    np.testing.assert_allclose(way.places(middle), [[70.3, 41.8]], atol=0.5)


def test_stretched_uses_all_levels() -> None:
    """Of a dark image the darkest level becomes black and the brightest white, whatever a few pixels are."""
    image = np.random.default_rng(0).integers(4, 14, (100, 100)).astype(np.uint8)
    image[0, :3] = 255
    shown = Way(stretched=True).apply(image)
    assert (np.median(shown[image == 4]), np.median(shown[image == 13])) == (0, 255)
    assert Way(stretched=True).apply(np.full((50, 50), 7, np.uint8)).std() == 0


def test_sizes_that_suit() -> None:
    """Nothing is searched in less than 16 pixels, and nothing large is enlarged."""
    small, large = np.zeros((20, 30), np.uint8), np.zeros((2000, 3000), np.uint8)
    assert Way().suits(small)
    assert not Way(0.5).suits(small)
    assert Way(2.0).suits(small)
    assert Way(0.5).suits(large)
    assert not Way(2.0).suits(large)


@pytest.mark.parametrize(("counts", "tried", "found"), [([5, 9], 1, 5), ([2, 3, 1], 3, 3), ([0, 0, 0], 3, None)])
def test_best_of_several(counts: list[int], tried: int, found: int | None) -> None:
    """The first way that finds enough ends the search; else the one that found most counts."""
    calls: list[Way] = []

    def search(image: Grey, way: Way) -> list[int]:
        calls.append(way)
        return [0] * counts[len(calls) - 1]

    most = best_result(np.zeros((50, 50), np.uint8), [Way(), Way(0.5), Way(2.0)], search, 4)
    assert len(calls) == tried
    assert (None if most is None else len(most)) == found
