"""Tests of features matched at predicted positions, against chance."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.vision.tracks.features import Features
from basecal.vision.tracks.guided_matching import match_predictions
from scene_images import random_looks, unit_rows

RADIUS_PX = 5.0


def grid(seed: int = 1) -> tuple[Features, np.ndarray]:
    """Features 40 px apart, and the descriptors of their points."""
    rng = np.random.default_rng(seed)
    pixels = np.stack(np.meshgrid(np.arange(50.0, 600, 40), np.arange(50.0, 400, 40)), -1).reshape(-1, 2)
    looks = random_looks(rng, len(pixels))
    return Features(pixels, unit_rows(looks + 0.02 * rng.standard_normal(looks.shape))), looks


def test_predicted_points_are_matched() -> None:
    """Predictions 2 px off match their own features, none by chance. A point that is not visible has no match."""
    features, looks = grid()
    predicted = features.pixels + np.array([1.6, -1.2])
    predicted[3] = np.nan
    found = match_predictions(features, predicted, looks, RADIUS_PX)
    assert dict(zip(found.point.tolist(), found.feature.tolist(), strict=True)) == {
        k: k for k in range(len(looks)) if k != 3
    }
    assert found.by_chance == 0


def test_match_requires_position_and_descriptor() -> None:
    """A similar feature beyond the radius is not matched, nor is a close one with another descriptor."""
    features, looks = grid()
    assert len(match_predictions(features, features.pixels + 8.0, looks, RADIUS_PX).point) == 0
    assert len(match_predictions(features, features.pixels, looks[::-1], RADIUS_PX).point) == 0


def test_each_feature_is_matched_once() -> None:
    """Of two predictions at one feature the one with the more similar descriptor is matched."""
    features, looks = grid()
    worse = unit_rows(looks + 0.03 * np.random.default_rng(2).standard_normal(looks.shape))
    found = match_predictions(
        features, np.tile(features.pixels, (2, 1)), np.concatenate([worse, features.descriptors]), 5.0
    )
    np.testing.assert_array_equal(np.sort(found.feature), np.arange(len(looks)))
    assert (found.point >= len(looks)).all()


def test_uniform_image_matches_by_chance() -> None:
    """If all features are similar, as many are matched beside the predictions as at them."""
    rng = np.random.default_rng(3)
    looks = unit_rows(np.ones((4000, 128)) + 0.1 * rng.standard_normal((4000, 128)))
    features = Features(rng.uniform(0, 1, (4000, 2)) * [640, 480], looks)
    found = match_predictions(features, rng.uniform(150, 330, (200, 2)), looks[:200], RADIUS_PX)
    assert len(found.point) > 100
    assert found.by_chance > 0.8 * len(found.point)


def test_empty_image_has_no_matches() -> None:
    """An image without features, or without predictions inside of it, has no matches."""
    features, looks = grid()
    empty = Features(np.zeros((0, 2)), np.zeros((0, 128), dtype=np.float32))
    assert match_predictions(empty, features.pixels, looks, RADIUS_PX).by_chance == 0
    assert len(match_predictions(features, np.full((len(looks), 2), np.nan), looks, RADIUS_PX).point) == 0


@pytest.mark.parametrize(("off_px", "found"), [(4.9, True), (5.1, False)])
def test_match_radius_is_a_limit(off_px: float, found: bool) -> None:
    features, looks = grid()
    near = match_predictions(features, features.pixels + off_px * np.array([0.6, 0.8]), looks, RADIUS_PX)
    assert len(near.point) == (len(looks) if found else 0)


@pytest.mark.parametrize(("squared", "found"), [(0.33, True), (0.37, False)])
def test_descriptor_distance_is_limited(squared: float, found: bool) -> None:
    """The squared distance is limited to 0.35 of the squared length."""
    looks = np.zeros((1, 128), dtype=np.float32)
    looks[0, 0] = 1.0
    other = np.zeros((1, 128), dtype=np.float32)
    other[0, 0] = 1 - squared / 2
    other[0, 1] = np.sqrt(1 - other[0, 0] ** 2)
    near = match_predictions(Features(np.array([[100.0, 90.0]]), other), np.array([[100.0, 90.0]]), looks, RADIUS_PX)
    assert len(near.point) == found


@pytest.mark.parametrize("way", [(50.0, 0.0), (-50.0, 0.0), (0.0, 50.0), (0.0, -50.0)])
def test_chance_is_mean_of_four_directions(way: tuple[float, float]) -> None:
    """A feature 50 px beside its prediction is matched by chance in one of four directions."""
    looks = np.zeros((1, 128), dtype=np.float32)
    looks[0, 0] = 1.0
    place = np.array([[300.0, 200.0]])
    found = match_predictions(Features(place + way, looks), place, looks, RADIUS_PX)
    assert (len(found.point), found.by_chance) == (0, 0.25)
