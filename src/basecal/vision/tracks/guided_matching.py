"""Matching of features to predicted points of the scene, with an estimate of chance matches."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from basecal.geometry import Array, IntArray
from basecal.vision.tracks.features import Descriptors, Features

_MOST_DISTANCE = 0.35  # squared distance of descriptors: correct matches have 0.1 to 0.4, others 0.6 and more
_OFFSET_PX = 50.0  # [px] offset from a prediction, at which only chance matches occur
_DIRECTIONS = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])


class Guided(NamedTuple):
    """Observations of predicted points in an image.

    Attributes:
        point: Index of the prediction, (n,).
        feature: Index of the matched feature, (n,).
        by_chance: Mean number of matches at offset predictions, which are chance matches.
    """

    point: IntArray
    feature: IntArray
    by_chance: float


def match_predictions(features: Features, predicted_px: Array, descriptors: Descriptors, radius_px: float) -> Guided:
    """Match features to predictions by position and descriptor.

    Args:
        features: Features of the image.
        predicted_px: (p, 2) [px]; NaN for points that are not visible.
        descriptors: Descriptors of the points, (p, 128).
        radius_px: Largest distance of a feature from its prediction [px].
    """
    point, feature = _nearest_features(features, predicted_px, descriptors, radius_px)
    displaced = [predicted_px + _OFFSET_PX * direction for direction in _DIRECTIONS]
    chance_matches = [_nearest_features(features, pixels, descriptors, radius_px)[0] for pixels in displaced]
    return Guided(point, feature, float(np.mean([len(each) for each in chance_matches])))


def _nearest_features(
    features: Features, predicted_px: Array, descriptors: Descriptors, radius_px: float
) -> tuple[IntArray, IntArray]:
    """Indices of predictions and of their most similar features, (n,) each, without repetition."""
    visible = np.flatnonzero(np.isfinite(predicted_px).all(1))
    none = np.zeros(0, dtype=np.int64)
    if not len(visible) or not len(features):
        return none, none
    near = cKDTree(features.pixels).query_ball_point(predicted_px[visible], radius_px)
    counts = np.array([len(each) for each in near])
    if not counts.any():
        return none, none
    point = np.repeat(visible, counts)
    feature = np.concatenate([np.asarray(each, dtype=np.int64) for each in near if each])
    distances = 2 - 2 * np.einsum("nk,nk->n", descriptors[point], features.descriptors[feature])
    order = np.argsort(distances, kind="stable")
    order = order[distances[order] < _MOST_DISTANCE]
    # Most similar first: each prediction and each feature once.
    order = order[np.sort(np.unique(point[order], return_index=True)[1])]
    order = order[np.sort(np.unique(feature[order], return_index=True)[1])]
    return point[order].astype(np.int64), feature[order].astype(np.int64)
