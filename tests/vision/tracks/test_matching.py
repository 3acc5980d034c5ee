"""Tests of matching features by descriptor and by the geometry of a rigid scene."""

from __future__ import annotations

import numpy as np

from basecal.geometry import SE3
from basecal.vision.tracks.features import Features
from basecal.vision.tracks.matching import MIN_MATCHES, match_descriptors, match_rigid
from scene_images import random_looks, unit_rows

FOCAL_PX = 800.0
SECOND_FROM_FIRST = SE3.from_rpy((0.02, -0.1, 0.3), (0.2, -0.05, 0.04))


def two_images(count: int, wrong: int = 0, seed: int = 1) -> tuple[Features, Features, tuple, np.ndarray]:
    """Features of points in two cameras, wrong ones last; planes, and the feature of each point."""
    rng = np.random.default_rng(seed)
    points = rng.uniform([-0.4, -0.3, 0.8], [0.4, 0.3, 1.4], (count, 3))
    other = SECOND_FROM_FIRST @ points
    planes = points[:, :2] / points[:, 2:], other[:, :2] / other[:, 2:]
    planes[1][count - wrong :] += rng.uniform(0.1, 0.3, (wrong, 2))
    looks = random_looks(rng, count)
    order = rng.permutation(count)
    first = Features(FOCAL_PX * planes[0], looks)
    second = Features(FOCAL_PX * planes[1][order], unit_rows(looks[order] + 0.02 * rng.standard_normal(looks.shape)))
    return first, second, (planes[0], planes[1][order]), np.argsort(order)


def test_noisy_copies_are_matched_one_to_one() -> None:
    """Noisy copies in another order are matched one to one."""
    first, second, _, of_point = two_images(80)
    found = match_descriptors(first.descriptors, second.descriptors)
    np.testing.assert_array_equal(found.first, np.arange(80))
    np.testing.assert_array_equal(found.second, of_point)


def test_ambiguous_descriptors_are_not_matched() -> None:
    """A feature that two of the other image resemble is skipped.

    In the other direction the more similar one is matched.
    """
    rng = np.random.default_rng(3)
    looks = random_looks(rng, 30)
    twice = unit_rows(looks[[*range(30), *range(5)]] + 0.02 * rng.standard_normal((35, 128)))
    assert not set(match_descriptors(looks, twice).first.tolist()) & set(range(5))
    assert len(match_descriptors(looks, twice).first) == 25
    back = match_descriptors(twice, looks).second.tolist()
    assert sorted(back) == list(range(30))


def test_unrelated_features_are_not_matched() -> None:
    """Hardly any of independently drawn descriptors match, and none if there are fewer than two."""
    rng = np.random.default_rng(4)
    assert len(match_descriptors(random_looks(rng, 200), random_looks(rng, 200)).first) < 3
    assert len(match_descriptors(random_looks(rng, 1), random_looks(rng, 200)).first) == 0


def test_epipolar_outliers_are_excluded() -> None:
    """Of 120 matches 30 are wrong: nearly all of these are excluded, and nearly all others are kept."""
    first, second, planes, of_point = two_images(120, wrong=30)
    found = match_rigid(first, second, planes, FOCAL_PX)
    assert found is not None
    np.testing.assert_array_equal(found.second, of_point[found.first])
    assert np.count_nonzero(found.first < 90) >= 88
    assert np.count_nonzero(found.first >= 90) <= 4


def test_features_moving_with_camera_are_excluded() -> None:
    """Features with constant positions in the image, like those of a gripper, are not matched."""
    first, second, planes, of_point = two_images(100)
    for pixels in (second.pixels, planes[1]):
        scale = FOCAL_PX if pixels is second.pixels else 1.0
        pixels[of_point[:20]] = scale * planes[0][:20] + scale / FOCAL_PX
    found = match_rigid(first, second, planes, FOCAL_PX)
    assert found is not None
    assert found.first.min() >= 20
    assert len(found.first) >= 78


def test_too_few_matches_are_refused() -> None:
    """A pair of images has no matches below `MIN_MATCHES`, or if no geometry explains them."""
    first, second, planes, _ = two_images(MIN_MATCHES - 1)
    assert match_rigid(first, second, planes, FOCAL_PX) is None
    first, second, planes, _ = two_images(2 * MIN_MATCHES, wrong=2 * MIN_MATCHES - 6)
    assert match_rigid(first, second, planes, FOCAL_PX) is None


def at_angles(*degrees: float) -> np.ndarray:
    """Descriptors in one plane, at given angles."""
    angles = np.radians(degrees)
    looks = np.zeros((len(degrees), 128), dtype=np.float32)
    looks[:, 0], looks[:, 1] = np.cos(angles), np.sin(angles)
    return looks


def test_ratio_test_of_descriptors() -> None:
    """The nearest descriptor must be within 0.8 of the distance of the second.

    Chords of 10 deg are tested beside those of 12 and of 13 deg.
    """
    for second, count in ((12.0, 0), (13.0, 1)):
        found = match_descriptors(at_angles(0.0, 90.0), at_angles(10.0, -second, 140.0))
        assert np.count_nonzero(found.first == 0) == count
    found = match_descriptors(at_angles(0.0, 90.0), at_angles(1.0, 91.0))
    assert (found.first.tolist(), found.second.tolist()) == ([0, 1], [0, 1])


def test_equal_features_are_matched_once() -> None:
    """The first of equal features is matched."""
    found = match_descriptors(at_angles(0.0, 0.0, 90.0), at_angles(1.0, 91.0))
    assert (found.first.tolist(), found.second.tolist()) == ([0, 2], [0, 1])


def test_fifteen_matches_are_enough() -> None:
    """The minimal number of matches suffices if they moved by more than 3 px."""
    first, second, planes, _ = two_images(MIN_MATCHES)
    found = match_rigid(first, second, planes, FOCAL_PX)
    assert found is not None
    assert len(found.first) == MIN_MATCHES


def test_features_must_move_by_three_pixels() -> None:
    """A feature that moves less is on the camera's own mount."""
    looks = at_angles(*np.linspace(0, 170, 40))
    pixels = np.random.default_rng(0).uniform(0, 600, (40, 2))
    for off, expected in ((2.9, False), (3.1, True)):
        moved = pixels + np.array([off, 0.0])
        planes = pixels / FOCAL_PX, moved / FOCAL_PX
        found = match_rigid(Features(pixels, looks), Features(moved, looks), planes, FOCAL_PX)
        assert (found is not None) == expected
