"""Matches of two images by descriptors, verified by epipolar geometry."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from basecal.geometry import Array, IntArray
from basecal.vision.tracks.features import Descriptors, Features

MIN_MATCHES = 15  # inliers of an essential matrix: fewer occur by chance
_RATIO = 0.8  # of the distances to the nearest and to the second nearest descriptor (Lowe 2004)
_MOST_ERROR_PX = 2.0  # [px] largest epipolar error of an inlier
_STILL_PX = 3.0  # [px] smallest motion: features on the camera's own mount do not move
MOST_ITERATIONS, CONFIDENCE = 2000, 0.999
"""Parameters of RANSAC: the largest number of samples, and the probability of an outlier-free sample."""


class Matches(NamedTuple):
    """Indices of matched features of two images, (n,) each."""

    first: IntArray
    second: IntArray


def match_descriptors(first: Descriptors, second: Descriptors) -> Matches:
    """Match features that are mutual nearest neighbours and pass the ratio test."""
    if min(len(first), len(second)) < 2:
        return Matches(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))
    similarity = first @ second.T
    rows = np.arange(len(first))
    best = similarity.argmax(1)
    best_similarity = similarity[rows, best]
    similarity[rows, best] = -1.0
    runner_up = similarity.max(1)
    similarity[rows, best] = best_similarity
    # Of unit vectors the squared distance is 2 - 2 cos.
    is_clear = 1 - best_similarity < _RATIO**2 * (1 - runner_up)
    mutual = np.flatnonzero(is_clear & (similarity.max(0)[best] == best_similarity))
    kept = mutual[np.sort(np.unique(best[mutual], return_index=True)[1])]  # the first of equal matches
    return Matches(kept.astype(np.int64), best[kept].astype(np.int64))


def match_rigid(first: Features, second: Features, planes: tuple[Array, Array], focal_px: float) -> Matches | None:
    """Matches that are inliers of an epipolar geometry; None if there are too few.

    Args:
        first: Features of the first image.
        second: Features of the second image.
        planes: Undistorted features of both images at unit depth, (n, 2) and (m, 2).
        focal_px: Focal length [px].
    """
    matches = match_descriptors(first.descriptors, second.descriptors)
    moved = np.linalg.norm(first.pixels[matches.first] - second.pixels[matches.second], axis=1) > _STILL_PX
    matches = Matches(matches.first[moved], matches.second[moved])
    if len(matches.first) < MIN_MATCHES:
        return None
    first_points, second_points = planes[0][matches.first], planes[1][matches.second]
    essential, inlier = cv2.findEssentialMat(
        first_points, second_points, np.eye(3), cv2.USAC_MAGSAC, CONFIDENCE, _MOST_ERROR_PX / focal_px, MOST_ITERATIONS
    )
    if essential is None or inlier is None or np.count_nonzero(inlier) < MIN_MATCHES:
        return None
    kept = np.flatnonzero(inlier.ravel())
    return Matches(matches.first[kept], matches.second[kept])
