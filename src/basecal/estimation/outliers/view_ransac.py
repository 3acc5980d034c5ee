"""Which points of a view agree with one another, and with where the view should be.

Each view is fitted to subsets of its points, alone or with a prior of its pose; of all fits the one that explains most
counts: least sum of squares, those beyond the limit counting as the limit. Source: Fischler & Bolles 1981, Torr &
Zisserman 2000 (the truncated cost).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from basecal.estimation.outliers.inlier_mask import masked
from basecal.estimation.view.measurement import (
    BearingMeasurement,
    Measurement,
    PixelMeasurement,
    PointMeasurement,
    ViewInformation,
)
from basecal.estimation.view.point_jacobians import point_jacobians
from basecal.estimation.view.view_pose import refined, view_poses
from basecal.geometry import SE3, Array, BoolArray, Camera

_DRAWS = 40
_DRAWN = 5
_FEW_POINTS = 8
_MOST_LEFT_OUT = 2
_ROUNDS = 10
_FIRST_STEPS = 4
_STEPS = 6
_SEED = 20240229

Points = PixelMeasurement | PointMeasurement


@dataclass(frozen=True, eq=False)
class Prior:
    """Where views should be: poses (n,) and the information of their right tangents, (n, 6, 6)."""

    camera_from_target: SE3
    information: Array

    def tension(self, camera_from_target: SE3) -> tuple[Array, Array]:
        """Squared distances in sigmas, (n,), and half their derivatives, (n, 6)."""
        error = (self.camera_from_target.inverse() @ camera_from_target).log()
        force = (self.information @ error[..., None])[..., 0]
        return np.einsum("ni,ni->n", error, force), force


@dataclass(frozen=True, eq=False)
class RansacViews:
    """What points of views agree on.

    Attributes:
        camera_from_target: (n,) the pose that explains most of each view.
        points: (n, p) points within the limit of it.
        squares: (n, p) squared residuals over sigma; infinite behind the camera, 0 where not seen.
        cost: (n,) truncated sum of squares, that of the prior included.
    """

    camera_from_target: SE3
    points: BoolArray
    squares: Array
    cost: Array


@dataclass(frozen=True, eq=False)
class _Held:
    """Views that are drawn to their priors, as a `Measurement` for one fit."""

    measurement: Measurement
    prior: Prior

    def linearise(self, camera_from_target: SE3, camera: Camera | None, lens: bool) -> ViewInformation:
        """What each view says, its prior included; see `Measurement`."""
        view = self.measurement.linearise(camera_from_target, camera, lens)
        tension, force = self.prior.tension(camera_from_target)
        return ViewInformation(view.cost + tension, view.gradient + force, view.information + self.prior.information)


def view_ransac(
    measurement: Points, near: SE3, camera: Camera | None, limit: float, prior: Prior | None = None
) -> RansacViews:
    """The largest agreement within each view.

    Args:
        measurement: The views, (n,).
        near: Where they may be, a start among others, (n,).
        camera: The lens; None for points in 3-D.
        limit: Squared residual over sigma beyond which a point does not agree.
        prior: Where they should be.
    """
    best = first = explained(measurement, near, camera, limit, prior)
    for start, points in _starts(measurement, near, camera):
        pose = _fitted(measurement, start, points, camera, prior, _FIRST_STEPS)
        best = _better(best, explained(measurement, pose, camera, limit, prior))
    settled = _settled(measurement, best, camera, limit, prior)
    return _better(settled, _settled(measurement, first, camera, limit, prior))


def explained(
    measurement: Points, pose: SE3, camera: Camera | None, limit: float, prior: Prior | None = None
) -> RansacViews:
    """What views' points agree on at given poses, (n,); the arguments are those of `view_ransac`."""
    rows = point_jacobians(measurement, pose, camera, False)
    assert rows is not None
    squares = np.where(measurement.seen & ~rows.seen, np.inf, np.sum(rows.residual**2, -1))
    tension = 0.0 if prior is None else prior.tension(pose)[0]
    cost = np.minimum(squares, limit).sum(-1) + tension
    return RansacViews(pose, measurement.seen & (squares <= limit), squares, cost)


def _fitted(
    measurement: Points, start: SE3, points: BoolArray, camera: Camera | None, prior: Prior | None, steps: int
) -> SE3:
    few = masked(measurement, points)
    return refined(few if prior is None else _Held(few, prior), start, camera, steps).camera_from_target


def _settled(
    measurement: Points, found: RansacViews, camera: Camera | None, limit: float, prior: Prior | None
) -> RansacViews:
    """Fitted to the points that agree, and judged again, until none changes sides."""
    for _ in range(_ROUNDS):
        pose = _fitted(measurement, found.camera_from_target, found.points, camera, prior, _STEPS)
        after = _better(explained(measurement, pose, camera, limit, prior), found)
        unchanged = np.array_equal(after.points, found.points)
        found = after
        if unchanged:
            break
    return found


def _better(first: RansacViews, second: RansacViews) -> RansacViews:
    """Of each view the cheaper of two; the first where they are alike."""
    take = second.cost < first.cost
    one, other = first.camera_from_target, second.camera_from_target
    return RansacViews(
        SE3(
            np.where(take[:, None, None], other.rotation, one.rotation),
            np.where(take[:, None], other.translation, one.translation),
        ),
        np.where(take[:, None], second.points, first.points),
        np.where(take[:, None], second.squares, first.squares),
        np.where(take, second.cost, first.cost),
    )


def _starts(measurement: Points, near: SE3, camera: Camera | None) -> Iterator[tuple[SE3, BoolArray]]:
    """Poses to start from, each with the points to fit first, (n, p)."""
    yield near, measurement.seen
    flat = np.linalg.matrix_rank(measurement.points_in_target - measurement.points_in_target.mean(0), 1e-6) < 3
    for points in _subsets(measurement.seen):
        if flat and isinstance(measurement, PixelMeasurement) and points.shape[-1] > _FEW_POINTS:
            assert camera is not None
            yield _alone(measurement, points, camera, near), points
        else:
            yield near, points


def _subsets(seen: BoolArray) -> Iterator[BoolArray]:
    """Of each view's points (n, p): all but one or two of a few, random ones of many."""
    n, p = seen.shape
    if p <= _FEW_POINTS:
        for count in range(1, min(_MOST_LEFT_OUT, p - 1) + 1):
            for out in combinations(range(p), count):
                yield seen & ~np.isin(np.arange(p), out)
        return
    rng = np.random.default_rng(_SEED)
    for _ in range(_DRAWS):
        order = np.argsort(np.where(seen, rng.random((n, p)), 2.0), axis=-1)
        points = np.zeros((n, p), dtype=bool)
        np.put_along_axis(points, order[:, :_DRAWN], True, axis=-1)
        yield points & seen


def _alone(measurement: PixelMeasurement, points: BoolArray, camera: Camera, near: SE3) -> SE3:
    """Each view's pose by the closed form from some of its points; `near` where there is none."""
    bearings, valid = camera.undistort(measurement.pixels)
    seen = points & valid
    chords = BearingMeasurement(
        measurement.points_in_target,
        np.where(seen[..., None], bearings, 0.0),
        np.where(seen, float(camera.focal.mean()), 0.0),
    )
    poses = view_poses(measurement.points_in_target, chords.bearings_in_camera, seen, chords)
    pose = poses.camera_from_target[:, 0]
    return SE3(
        np.where(poses.found[:, None, None], pose.rotation, near.rotation),
        np.where(poses.found[:, None], pose.translation, near.translation),
    )
