"""Tests of image features: their positions, distribution, masks and cache."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.vision.tracks import features
from basecal.vision.tracks.features import (
    DESCRIPTOR_LENGTH,
    MAX_FEATURES,
    Features,
    _distributed_indices,
    _mask,
    cached_features,
    descriptor_levels,
    find_features,
    identified_features,
    unit_descriptors,
)

SHIFT = (31, 17)  # [px]
IMAGE = np.random.default_rng(1).integers(0, 255, (60, 80)).repeat(2, 0).repeat(2, 1).astype(np.uint8)
SQUARE = np.array([[20.0, 20.0], [60.0, 20.0], [60.0, 60.0]])


def blots(seed: int = 1, shape: tuple[int, int] = (300, 400)) -> np.ndarray:
    """Grey levels of a textured image."""
    rng = np.random.default_rng(seed)
    level = np.zeros(shape, dtype=np.float32)
    for size in (5, 12, 30):
        small = rng.standard_normal((shape[0] // size + 2, shape[1] // size + 2)).astype(np.float32)
        level += cv2.resize(small, (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC)
    return np.clip(128 + 40 * level, 0, 255).astype(np.uint8)


def test_descriptors_have_unit_length() -> None:
    """Every feature is inside of the image, with a descriptor of length one."""
    found = find_features(blots())
    assert 100 < len(found) <= MAX_FEATURES
    assert found.descriptors.shape == (len(found), DESCRIPTOR_LENGTH)
    np.testing.assert_allclose(np.linalg.norm(found.descriptors, axis=1), 1.0, atol=1e-5)
    assert (found.pixels > -0.5).all()
    assert (found.pixels < [399.5, 299.5]).all()


@pytest.mark.journey
def test_features_move_with_the_image() -> None:
    """Two crops of one image have features at the same positions, to 0.1 px in the median, without bias."""
    large = blots(2)
    right, down = SHIFT
    whole, crop = find_features(large), find_features(np.ascontiguousarray(large[down:, right:]))
    back = crop.pixels + SHIFT
    apart = whole.pixels[:, None] - back[None]
    nearest = np.linalg.norm(apart, axis=2).argmin(0)
    off = whole.pixels[nearest] - back
    near = np.linalg.norm(off, axis=1) < 1
    assert near.mean() > 0.6
    assert np.median(np.linalg.norm(off[near], axis=1)) < 0.1
    assert np.abs(off[near].mean(0)).max() < 0.02


@pytest.mark.journey
def test_spots_are_found_at_their_centres() -> None:
    """Features of round spots are at their centres to 0.03 px in the mean.

    The centre of the top-left pixel is (0, 0).
    """
    rng = np.random.default_rng(5)
    rows = np.stack(np.meshgrid(np.arange(40, 600, 50), np.arange(40, 440, 50)), -1).reshape(-1, 2)
    middles = rows + rng.uniform(-5, 5, rows.shape)
    x, y = np.meshgrid(np.arange(640), np.arange(480))
    spots = sum(np.exp(-((x - mx) ** 2 + (y - my) ** 2) / (2 * 6.0**2)) for mx, my in middles)
    found = find_features(np.round(60 + 150 * spots).astype(np.uint8))
    off = np.array([(found.pixels - m)[np.linalg.norm(found.pixels - m, axis=1).argmin()] for m in middles])
    near = np.linalg.norm(off, axis=1) < 1
    assert near.mean() > 0.9
    assert np.abs(off[near].mean(0)).max() < 0.03


def test_features_have_unique_positions() -> None:
    """A position with two gradient directions counts once."""
    pixels = np.round(find_features(blots(3)).pixels, 2)
    assert len(np.unique(pixels, axis=0)) == len(pixels)


@pytest.mark.journey
def test_masked_regions_have_no_features() -> None:
    """No features are found within the hull of a moving target; elsewhere there are as many as before."""
    square = np.array([[100.0, 80.0], [200.0, 80.0], [200.0, 180.0], [100.0, 180.0]])
    every, found = find_features(blots()), find_features(blots(), [square])
    inside = ((found.pixels > 100) & (found.pixels < [200, 180])).all(1) & (found.pixels > [0, 80]).all(1)
    assert not inside.any()
    assert len(every) * 0.5 < len(found) < len(every)
    assert len(find_features(blots(), [square[:2]])) == len(every)


@pytest.mark.journey
def test_many_features_are_thinned_evenly() -> None:
    """A large image keeps at most `MAX_FEATURES` features, about a quarter of them in each quarter of it."""
    found = find_features(blots(4, (900, 1200)))
    assert len(found) == MAX_FEATURES
    right, lower = (found.pixels > [600, 450]).T
    quarters = np.bincount(right + 2 * lower.astype(int), minlength=4)
    assert quarters.min() > 0.2 * MAX_FEATURES


def test_blank_image_has_no_features() -> None:
    """An image without texture gives empty arrays of the right shape."""
    found = find_features(np.full((120, 160), 90, dtype=np.uint8))
    assert found.pixels.shape == (0, 2)
    assert found.descriptors.shape == (0, DESCRIPTOR_LENGTH)


def kept_files(folder: Path) -> list[Path]:
    """Files of the cache."""
    return sorted((folder / "derived" / "features").iterdir())


def test_cached_features_equal_computed_ones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A second call reads the file, computes no features, and gives the same to the last bit."""
    first = cached_features(tmp_path, "key", IMAGE, [])
    assert len(first) > 50

    def fail(*_: object) -> Features:
        raise AssertionError("features are found again")

    monkeypatch.setattr(features, "find_features", fail)
    again = cached_features(tmp_path, "key", IMAGE, [])
    np.testing.assert_array_equal(again.pixels, first.pixels)
    np.testing.assert_array_equal(again.descriptors, first.descriptors)
    np.testing.assert_allclose(np.linalg.norm(again.descriptors, axis=1), 1.0, atol=1e-5)


def test_cache_name_depends_on_image_and_mask(tmp_path: Path) -> None:
    """The name of the file has the hash of the image and of its mask."""
    for key, covered in (("key", []), ("other", []), ("key", [SQUARE]), ("key", [])):
        cached_features(tmp_path, key, IMAGE, covered)
    assert len(kept_files(tmp_path)) == 3


@pytest.mark.parametrize("broken", [b"x" * 17, np.full(2, np.nan).tobytes() + bytes(128)])
def test_damaged_cache_file_is_rewritten(tmp_path: Path, broken: bytes) -> None:
    """A file of a wrong length, or with positions that are no numbers, is computed and written again."""
    first = cached_features(tmp_path, "key", IMAGE, [])
    (path,) = kept_files(tmp_path)
    whole = path.read_bytes()
    path.write_bytes(broken)
    assert len(cached_features(tmp_path, "key", IMAGE, [])) == len(first)
    assert path.read_bytes() == whole


def test_unwritable_folder_is_tolerated(tmp_path: Path) -> None:
    """Features are found even if `derived` is a file."""
    (tmp_path / "derived").write_text("")
    assert len(cached_features(tmp_path, "key", IMAGE, [])) > 50


def test_strongest_feature_of_each_cell_comes_first() -> None:
    """The second of a cell comes after the first of all cells. A position counts once, with its strongest feature."""
    pixels = np.array([[5.0, 5.0], [6.0, 6.0], [5.0, 5.0], [395.0, 295.0], [30.0, 5.0], [5.0, 30.0]])
    response = np.array([0.5, 0.6, 0.9, 0.1, 0.2, 0.3])
    assert _distributed_indices(pixels, response, (300, 400)).tolist() == [2, 5, 4, 3, 1]


def test_cells_are_a_grid_over_the_image() -> None:
    """The last column and row of cells extend to the border and include pixels just beyond it."""
    pixels = np.array([[16.6, 0.0], [16.7, 0.0], [400.4, 300.4], [399.0, 299.0], [-0.4, -0.4]])
    order = _distributed_indices(pixels, np.array([0.9, 0.8, 0.7, 0.6, 0.5]), (300, 400)).tolist()
    assert order == [0, 1, 2, 3, 4]
    assert _distributed_indices(pixels[[0, 4, 1]], np.array([0.9, 0.8, 0.1]), (300, 400)).tolist() == [0, 2, 1]
    assert _distributed_indices(pixels[[2, 3, 1]], np.array([0.9, 0.8, 0.1]), (300, 400)).tolist() == [0, 2, 1]


def test_masks_are_enlarged_about_their_centre() -> None:
    """Masks are enlarged by 30 %. Two pixels mask nothing, and every target has its own mask."""
    square = np.array([[100.0, 80.0], [200.0, 80.0], [200.0, 180.0], [100.0, 180.0]])
    other = square + np.array([150, 100])
    rows, columns = np.nonzero(_mask((300, 400), [square, square[:2], other]) == 0)
    first = columns < 216
    assert (columns[first].min(), columns[first].max(), rows[first].min(), rows[first].max()) == (85, 215, 65, 195)
    assert (columns.max(), rows.max()) == (365, 295)
    assert (_mask((300, 400), [square[:3]]) == 0).any()
    assert set(np.unique(_mask((300, 400), [square]))) == {0, 255}


def test_identified_points_have_unique_descriptors() -> None:
    """The descriptor of a number is reproducible, of length one and non-negative. Negative numbers are allowed."""
    looks = identified_features(np.array([3, -3, 3]), np.zeros((3, 2))).descriptors
    np.testing.assert_array_equal(looks[0], looks[2])
    assert looks.min() >= 0
    np.testing.assert_allclose(np.linalg.norm(looks, axis=1), 1, atol=1e-6)
    assert looks[0] @ looks[1] < 0.9
    assert identified_features(np.array([], dtype=int), np.zeros((0, 2))).descriptors.shape == (0, DESCRIPTOR_LENGTH)


def test_descriptors_survive_quantisation() -> None:
    """Descriptors as bytes are accurate to half a level, and a zero one stays zero."""
    shares = np.zeros((2, DESCRIPTOR_LENGTH), dtype=np.float32)
    shares[0, :4] = 0.5
    levels = descriptor_levels(shares)
    assert levels[0, :5].tolist() == [128, 128, 128, 128, 0]
    np.testing.assert_allclose(unit_descriptors(levels), shares, atol=1e-6)
