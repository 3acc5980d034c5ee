"""Transform between the scenes of two cameras: several candidates are tried, and image matches select the best.

A transform predicts points of the first camera in the images of the second. Its evidence is the number of points found
there, less the number that chance finds near these places. A repeated object gives more than one plausible transform.
Tracks of two cameras are merged if images show the same point. `benchmarks.scene` evaluates the limits.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.scene.images import Images
from basecal.accuracy.scene.one_camera import OneCamera
from basecal.estimation.scene.adjust import SceneFit
from basecal.estimation.scene.alignment import alignments, are_equal, project_points, refine_transform
from basecal.estimation.scene.views import FEWEST_VIEWS, SceneViews, Tracks
from basecal.geometry import SE3, Array, IntArray
from basecal.numerics.batch import concatenate, take
from basecal.numerics.tied_blocks import components
from basecal.vision.tracks.features import Descriptors
from basecal.vision.tracks.guided_matching import match_predictions
from basecal.vision.tracks.matching import match_descriptors

_MOST_TRANSFORMS = 12  # transforms that are tried
_TOLERANCE = 0.015  # [1] largest distance of paired points, relative to the distance to the cameras
_RADII_PX = (12.0, 6.0, 4.0)  # [px] search radii around predictions, in turn
_SAME_M_RAD = 0.02  # [m, rad] difference below which two refined transforms are the same
_CUBE_M = 0.15  # [m] side of the cubes that are the places
_FEWEST_IN_CUBE = 4  # points of a place


@dataclass(frozen=True, eq=False)
class Join:
    """A transform between the frames of two cameras' robots, and its evidence in the images.

    Attributes:
        second_from_first: The transform.
        sightings: Image points of the second camera that match predicted points of the first.
        by_chance: Number of matches expected by chance near the predictions.
        common: Share of places of the first camera's scene that the second shows; see `common_share`.
        rival: Evidence of the second-best transform relative to this one, the smaller of score and place ratios.
    """

    second_from_first: SE3
    sightings: Tracks
    by_chance: float
    common: float | None
    rival: float = 0.0

    @property
    def score(self) -> float:
        """Number of sightings above the number by chance, in standard deviations of the latter."""
        return float((len(self.sightings) - self.by_chance) / np.sqrt(max(self.by_chance, 1.0)))


def find_join(images: Images, first: OneCamera, second: OneCamera) -> Join | None:
    """Return the transform with the most evidence in the images; None if no pairs of points agree."""
    pairs, tolerance = paired_points(images, first, second)
    points = first.adjustment.state.points
    one, other = points[pairs[:, 0]], second.adjustment.state.points[pairs[:, 1]]
    descriptors = images.descriptors(first.tracks)
    tried = [
        _judge_transform(images, points, descriptors, second, transform)
        for transform, _ in alignments(one, other, tolerance, _MOST_TRANSFORMS)
    ]
    if not tried:
        return None
    best, *others = sorted(tried, key=lambda each: -each.score)
    transform = best.second_from_first
    rivals = [each for each in others if not are_equal(each.second_from_first, transform, one, _SAME_M_RAD)]
    return replace(best, rival=max((_evidence_share(each, best) for each in rivals), default=0.0))


def _evidence_share(rival: Join, best: Join) -> float:
    """Evidence of a second transform relative to the best: the smaller of the ratios by score and by places.

    An object that moved has many points but occupies few places.
    """
    by_score = rival.score / max(best.score, 1e-9)
    if best.common is None or rival.common is None:
        return by_score
    return min(by_score, rival.common / max(best.common, 1e-9))


def paired_points(images: Images, first: OneCamera, second: OneCamera) -> tuple[IntArray, Array]:
    """Pair the points of two cameras that match each other in the most image pairs.

    Returns:
        Indices of paired points, (n, 2), and the largest distance allowed of each pair, (n,) [m].
    """
    votes: Counter[tuple[int, int]] = Counter()
    of_second = list(_view_points(images, second))
    for points, descriptors in _view_points(images, first):
        for others, of_others in of_second:
            found = match_descriptors(descriptors, of_others)
            votes.update(zip(points[found.first].tolist(), others[found.second].tolist(), strict=True))
    best_of_first, best_of_second = dict[int, int](), dict[int, int]()
    for (p, q), _ in votes.most_common():
        best_of_first.setdefault(p, q)
        best_of_second.setdefault(q, p)
    pairs = np.array([(p, q) for p, q in best_of_first.items() if best_of_second[q] == p], dtype=np.int64)
    pairs = pairs.reshape(-1, 2)
    return pairs, _TOLERANCE * np.hypot(
        _distances(first.adjustment)[pairs[:, 0]], _distances(second.adjustment)[pairs[:, 1]]
    )


def _view_points(images: Images, one: OneCamera) -> Iterator[tuple[IntArray, Descriptors]]:
    """Yield the points that each view shows, (n,), and their descriptors in that view."""
    tracks = one.tracks
    for view in np.unique(tracks.view):
        mine = tracks.view == view
        yield tracks.point[mine], images.features[view].descriptors[tracks.feature[mine]]


def _distances(fit: SceneFit) -> Array:
    """Mean distance of each point to the cameras that see it, (p,) [m]."""
    centre = fit.state.world_from_camera(fit.views).translation[fit.tracks.view]
    distance = np.linalg.norm(fit.state.points[fit.tracks.point] - centre, axis=1)
    return np.bincount(fit.tracks.point, distance) / np.maximum(np.bincount(fit.tracks.point), 1)


def _judge_transform(
    images: Images, points: Array, descriptors: Descriptors, second: OneCamera, transform: SE3
) -> Join:
    """Refine a transform on matches of the first camera's points in the second camera's images, and evaluate it."""
    fit = second.adjustment
    camera_from_world, lens = fit.state.world_from_camera(fit.views).inverse(), fit.state.lenses[0]
    for radius_px in _RADII_PX:
        pixels = project_points(points, camera_from_world @ transform, lens)
        seen, by_chance = list[Tracks](), 0.0
        for view, row in enumerate(second.rows):
            features = images.features[row]
            found = match_predictions(features, pixels[view], descriptors, radius_px)
            found_px = features.pixels[found.feature]
            seen.append(Tracks(np.full(len(found_px), view), found.point, found_px, found.feature))
            by_chance += found.by_chance
        sightings = concatenate(seen)
        if len(sightings) < 6:
            break
        transform = refine_transform(points, sightings, camera_from_world, transform, lens)
    return Join(transform, sightings, by_chance, common_share(points, fit, transform, sightings))


def common_share(points: Array, second: SceneFit, transform: SE3, sightings: Tracks) -> float | None:
    """Share of places of the first camera's scene that the second shows, among those predicted within its images.

    If each camera sees one of two equal objects, the objects match but their surroundings do not. Places are cubes with
    equal weight, as objects have more texture than their surroundings.

    Args:
        points: (p, 3) points of the first camera's scene [m].
        second: Scene of the second camera.
        transform: Transform from the first camera's world to the second camera's world.
        sightings: Matches of the points in views of the second camera.

    Returns:
        The share, or None if no cube has enough points.
    """
    camera_from_world = second.state.world_from_camera(second.views).inverse()
    pixels = project_points(points, camera_from_world @ transform, second.state.lenses[0])
    predicted = np.flatnonzero(np.isfinite(pixels).all(-1).sum(0) >= FEWEST_VIEWS)
    cubes = np.floor(points[predicted] / _CUBE_M).astype(np.int64)
    _, number, total = np.unique(cubes, axis=0, return_inverse=True, return_counts=True)
    found = np.bincount(number.ravel(), np.isin(predicted, sightings.point), len(total))
    is_place = total >= _FEWEST_IN_CUBE
    return float(np.mean(found[is_place] >= total[is_place] / 2)) if is_place.any() else None


def merged_tracks(ones: Sequence[OneCamera], joins: Mapping[int, Join]) -> Tracks:
    """Merge the tracks of all cameras into tracks of one scene.

    Args:
        ones: Scene of each camera alone.
        joins: Transform from the first camera's scene, by index of the other camera.
    """
    offsets = np.cumsum([0, *(each.adjustment.tracks.count for each in ones)])
    parts = [replace(each.tracks, point=each.tracks.point + at) for each, at in zip(ones, offsets, strict=False)]
    ties = [np.zeros((0, 2), dtype=np.int64)]
    for index, join in joins.items():
        more, tied = _new_sightings(ones[index].adjustment.tracks, join.sightings)
        parts.append(replace(more, view=ones[index].rows[more.view]))
        ties.append(tied + offsets[[index, 0]])
    tracks = concatenate(parts)
    tracks = replace(tracks, point=components(np.concatenate(ties), int(offsets[-1]))[tracks.point])
    _, groups, counts = np.unique(
        np.column_stack([tracks.view, tracks.point]), axis=0, return_inverse=True, return_counts=True
    )
    return tracks.take(counts[groups.ravel()] == 1)[0]


def shared_points(views: SceneViews, tracks: Tracks, second: int) -> tuple[int, tuple[int, int]]:
    """Count the points that the first and a second camera share, each seen in two views or more by both.

    Returns:
        Number of shared points, and the number of views of each camera that show some of them.
    """
    camera = views.camera[tracks.view]
    in_views = [np.bincount(tracks.point[camera == each], minlength=tracks.count) for each in (0, second)]
    is_shared = (in_views[0] >= 2) & (in_views[1] >= 2)
    of_both = [np.unique(tracks.view[(camera == each) & is_shared[tracks.point]]) for each in (0, second)]
    return int(is_shared.sum()), (len(of_both[0]), len(of_both[1]))


def _new_sightings(own: Tracks, sightings: Tracks) -> tuple[Tracks, IntArray]:
    """Split sightings of the other camera's points into new image points and pairs of identical points.

    An own point and another camera's point are identical if most matched features of the own point show the other.

    Returns:
        Sightings by features that belong to no own track, and pairs of own and other points, (t, 2).
    """
    view_count = max(own.view.max(), sightings.view.max(initial=0)) + 1
    feature_count = max(own.feature.max(), sightings.feature.max(initial=0)) + 1
    known = np.full((view_count, feature_count), -1)
    known[own.view, own.feature] = own.point
    point = known[sightings.view, sightings.feature]
    pairs, votes = np.unique(np.column_stack([point, sightings.point])[point >= 0], axis=0, return_counts=True)
    is_most = votes > np.bincount(pairs[:, 0], votes)[pairs[:, 0]] / 2
    return take(sightings, point < 0), pairs[is_most]
