"""Which transform joins the scenes of two cameras: several are tried, and images judge.

A transform predicts points of one in the images of the other. Those found there, beyond those that chance finds
beside these places, are its evidence. A repeated object makes rivals.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.scene.one_camera import OneCamera
from basecal.accuracy.scene.pictures import Pictures
from basecal.estimation.scene.alignment import alignments, are_one
from basecal.estimation.scene.base import Sightings, project_points, refine_transform
from basecal.geometry import SE3, Array, IntArray
from basecal.vision.tracks.features import Descriptors
from basecal.vision.tracks.guided_matching import match_predictions
from basecal.vision.tracks.matching import match

_MOST_TRANSFORMS = 12  # transforms that are tried
_TOLERANCE = 0.015  # [1] of the distance to the cameras, by which paired points may be apart
_RADII_PX = (12.0, 6.0, 4.0)  # [px] about predictions, one after another
_NEAR_M, _NEAR_RAD = 0.02, 0.02  # within which two refined transforms are one


@dataclass(frozen=True, eq=False)
class Join:
    """A transform between the frames of two cameras' robots, and what images say of it.

    Attributes:
        second_from_first: The transform.
        found: Image points that were found where it predicts them.
        by_chance: How many chance finds beside these places.
        sightings: Of points of the first in views of the second: view, point and feature, (n,) each.
        views: How many views of the second show points of the first.
        rival: The score of the best other transform; 0 if there is none.
    """

    second_from_first: SE3
    found: int
    by_chance: float
    sightings: tuple[IntArray, IntArray, IntArray]
    views: int
    rival: float = 0.0

    @property
    def score(self) -> float:
        """The excess over the count by chance, in its standard deviations."""
        return float((self.found - self.by_chance) / np.sqrt(max(self.by_chance, 1.0)))


def join(pictures: Pictures, first: OneCamera, second: OneCamera) -> Join | None:
    """The transform that images speak for most, with the score of its rival; None if no pairs of points agree."""
    assert first.fit is not None
    assert second.fit is not None
    pairs, tolerance = paired_points(pictures, first, second)
    if not len(pairs):
        return None
    one, other = first.fit.state.points[pairs[:, 0]], second.fit.state.points[pairs[:, 1]]
    looks = first.descriptors(pictures)
    tried = [
        _judge_transform(pictures, first, second, each.second_from_first, looks)
        for each in alignments(one, other, tolerance, _MOST_TRANSFORMS)
    ]
    ranked = sorted(tried, key=lambda each: -each.score)
    if not ranked:
        return None
    best = ranked[0]
    at = best.second_from_first
    rivals = [each for each in ranked[1:] if not are_one(each.second_from_first, at, one, _NEAR_M, _NEAR_RAD)]
    return replace(best, rival=max((each.score for each in rivals), default=0.0))


def paired_points(pictures: Pictures, first: OneCamera, second: OneCamera) -> tuple[IntArray, Array]:
    """Points of both with the same look in most pairs of images, (n, 2), and how far they may be apart, (n,) [m]."""
    assert first.fit is not None
    assert second.fit is not None
    votes: Counter[tuple[int, int]] = Counter()
    seen = [_view_points(pictures, each) for each in (first, second)]
    for points, descriptors in seen[0]:
        for others, of_others in seen[1]:
            found = match(descriptors, of_others)
            votes.update(zip(points[found.first].tolist(), others[found.second].tolist(), strict=True))
    best_of_first, best_of_second = dict[int, int](), dict[int, int]()
    for (p, q), _ in votes.most_common():
        best_of_first.setdefault(p, q)
        best_of_second.setdefault(q, p)
    pairs = np.array([(p, q) for p, q in best_of_first.items() if best_of_second[q] == p], dtype=np.int64)
    pairs = pairs.reshape(-1, 2)
    distances = [_distances(each)[pairs[:, k]] for k, each in enumerate((first, second))]
    return pairs, _TOLERANCE * np.hypot(*distances)


def _view_points(pictures: Pictures, one: OneCamera) -> list[tuple[IntArray, Descriptors]]:
    """Points that each view shows, and their descriptors there."""
    assert one.fit is not None
    tracks = one.fit.tracks
    rows = [np.flatnonzero(tracks.view == view) for view in range(len(one.rows))]
    return [
        (tracks.point[mine], pictures.features[one.rows[view]].descriptors[one.feature[mine]])
        for view, mine in enumerate(rows)
        if len(mine)
    ]


def _distances(one: OneCamera) -> Array:
    """Mean distance of each point to the cameras that see it, (p,) [m]."""
    assert one.fit is not None
    fit = one.fit
    centre = fit.state.world_from_camera(fit.views).translation[fit.tracks.view]
    distance = np.linalg.norm(fit.state.points[fit.tracks.point] - centre, axis=1)
    return np.asarray(np.bincount(fit.tracks.point, distance) / np.maximum(np.bincount(fit.tracks.point), 1))


def _judge_transform(
    pictures: Pictures, first: OneCamera, second: OneCamera, transform: SE3, looks: Descriptors
) -> Join:
    """A transform refined on what images of the second show of points of the first."""
    assert first.fit is not None
    assert second.fit is not None
    points, fit = first.fit.state.points, second.fit
    camera_from_world = fit.state.world_from_camera(fit.views).inverse()
    lens = fit.state.lenses[0]
    view, point, feature = (np.zeros(0, dtype=np.int64) for _ in range(3))
    by_chance = 0.0
    for radius_px in _RADII_PX:
        pixels = project_points(points, camera_from_world @ transform, lens)
        guided = [
            match_predictions(pictures.features[row], pixels[k], looks, radius_px) for k, row in enumerate(second.rows)
        ]
        view = np.repeat(np.arange(len(guided)), [len(each.point) for each in guided])
        point = np.concatenate([each.point for each in guided])
        feature = np.concatenate([each.feature for each in guided])
        by_chance = sum(each.by_chance for each in guided)
        if len(point) < 6:
            break
        places = np.array([pictures.features[second.rows[v]].pixels[f] for v, f in zip(view, feature, strict=True)])
        transform = refine_transform(points, Sightings(view, point, places), camera_from_world, transform, lens)
    return Join(transform, len(point), by_chance, (view, point, feature), len(np.unique(view)))
