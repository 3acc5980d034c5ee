"""Localisation of a camera in a scene of known points."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from basecal.geometry import SE3, Array, Camera, IntArray
from basecal.vision.tracks.features import Descriptors, Features
from basecal.vision.tracks.matching import CONFIDENCE, MOST_ITERATIONS, match_descriptors

FEWEST_POINTS = 30  # inliers of a pose
_MOST_ERROR_PX = 3.0  # [px] largest reprojection error of an inlier


class Located(NamedTuple):
    """A pose, and the indices of its inlier points and features, (n,) each."""

    camera_from_world: SE3
    point: IntArray
    feature: IntArray


def locate_camera(features: Features, descriptors: Descriptors, points: Array, lens: Camera) -> Located | None:
    """Estimate a camera's pose by P3P RANSAC; None if there are too few inliers. Source: Ke & Roumeliotis 2017 (P3P).

    Args:
        features: Features of the image.
        descriptors: Descriptors of the points, (p, 128).
        points: Points in the world, (p, 3) [m].
        lens: Lens of the camera.
    """
    matches = match_descriptors(descriptors, features.descriptors)
    unit, valid = lens.undistort(features.pixels[matches.second])
    kept = np.flatnonzero(valid & (unit[:, 2] > 0)) if len(matches.first) else np.zeros(0, dtype=np.int64)
    if len(kept) < FEWEST_POINTS:
        return None
    point, feature = matches.first[kept], matches.second[kept]
    plane, tolerance = unit[kept, :2] / unit[kept, 2:], _MOST_ERROR_PX / float(lens.focal.mean())
    is_found, rotvec, translation, inlier = cv2.solvePnPRansac(
        points[point], plane, np.eye(3), None, None, None, False, MOST_ITERATIONS, tolerance, CONFIDENCE, None,
        cv2.SOLVEPNP_AP3P,
    )  # fmt: skip
    if not is_found or inlier is None or len(inlier) < FEWEST_POINTS:
        return None
    rows = inlier.ravel()
    rotvec, translation = cv2.solvePnPRefineLM(points[point[rows]], plane[rows], np.eye(3), None, rotvec, translation)
    return Located(SE3.from_rotvec(rotvec.ravel(), translation.ravel()), point[rows], feature[rows])
