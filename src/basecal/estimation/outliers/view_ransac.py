"""Points of views that agree with one another, and with a prior of the view's pose.

Each view is fitted to subsets of its points, with or without a prior of its pose; all views and subsets form one batch.
The best fit has the lowest truncated cost: the sum of squared residuals, each limited to the threshold of inliers.
Source: Fischler & Bolles 1981, Torr & Zisserman 2000 (the truncated cost).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from basecal.estimation.view.bearings import BearingMeasurement
from basecal.estimation.view.measurement import Measurement, ViewInformation
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.target_points import SeenPoints
from basecal.estimation.view.view_pose import refine_poses, view_poses
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray
from basecal.numerics.batch import choose_entries, concatenate, take
from basecal.numerics.spectral import dimension

# Number and size of random subsets of many points: with a third of outliers, one in eight subsets is clean.
_DRAWS = 40
_DRAWN_POINTS = 5
FEW_POINTS = 8
_MOST_EXCLUDED = 2  # maximum number of outliers among few points: with three, the remaining ones may agree by chance
_FIT_ROUNDS = 10  # maximum number of fits to the inliers: three or four suffice
_FIRST_STEPS = 4  # steps of a pose from a subset, enough to rank it
_FIT_STEPS = 6  # steps of a pose from the inliers, which starts near the optimum
_SEED = 20240229  # arbitrary
# Number of points that are processed at a time, in arrays of a few MB.
_CHUNK_POINTS = 50_000


@dataclass(frozen=True, eq=False)
class Prior:
    """Normal prior of the poses of views: mean (n,) and information of their right tangents, (n, 6, 6)."""

    camera_from_target: SE3
    information: Array

    def tension(self, camera_from_target: SE3) -> tuple[Array, Array]:
        """Squared deviations of poses from the prior, in sigmas, (n,), and half their derivatives, (n, 6)."""
        error = (self.camera_from_target.inverse() @ camera_from_target).log()
        force = (self.information @ error[..., None])[..., 0]
        return np.einsum("ni,ni->n", error, force), force


@dataclass(frozen=True, eq=False)
class RansacViews:
    """Largest consensus of points in each view.

    Attributes:
        camera_from_target: (n,) pose of each view with the lowest truncated cost.
        points: (n, p) mask of inliers of this pose.
        squares: (n, p) squared residuals in sigmas; infinite behind the camera, 0 for points that are not seen.
        cost: (n,) truncated sum of squares, including the prior.
    """

    camera_from_target: SE3
    points: BoolArray
    squares: Array
    cost: Array

    def better(self, rival: RansacViews) -> RansacViews:
        """For each view, the consensus with the lower cost; this one if the costs are equal."""
        return choose_entries(rival.cost < self.cost, rival, self)


@dataclass(frozen=True, eq=False)
class _WithPrior:
    """Views with priors of their poses; implements the part of `Measurement` that a fit needs."""

    measurement: Measurement
    prior: Prior

    def linearise(self, camera_from_target: SE3, camera: Camera | None, with_lens: bool) -> ViewInformation:
        """Linearise the views and their priors; see `Measurement`."""
        view = self.measurement.linearise(camera_from_target, camera, with_lens)
        tension, force = self.prior.tension(camera_from_target)
        return ViewInformation(view.cost + tension, view.gradient + force, view.information + self.prior.information)

    def take(self, views: IntArray) -> _WithPrior:
        """Return the views at these indices."""
        return take(self, views)


@dataclass(frozen=True, eq=False)
class PointViews:
    """Views of one camera, (n,), with an optional prior of their poses.

    Attributes:
        measurement: The views.
        camera: The lens; None for points in 3-D.
        prior: Prior of the views' poses; None without one.
    """

    measurement: SeenPoints
    camera: Camera | None
    prior: Prior | None = None

    def fit(self, start: SE3, points: BoolArray, steps: int) -> SE3:
        """Fit poses, (n,), to a mask of points (n, p) and to the prior."""
        masked = self.measurement.mask_points(points)
        return refine_poses(
            masked if self.prior is None else _WithPrior(masked, self.prior), start, self.camera, steps
        ).camera_from_target

    def agreement(self, pose: SE3, limit: float) -> RansacViews:
        """Consensus of points with poses, (n,); the limit of inliers is a squared residual in sigmas."""
        # Squared residuals in sigmas, (n, p); infinite behind the camera, 0 for points that are not seen.
        measurement = self.measurement
        residuals = measurement.residuals(pose, self.camera)
        squares = np.sum(residuals**2, -1) * measurement.weight**2
        has_residual = np.isfinite(squares) & (measurement.weight > 0)
        squares = np.where(measurement.seen, np.where(has_residual, squares, np.inf), 0.0)
        tension = 0.0 if self.prior is None else self.prior.tension(pose)[0]
        cost = np.minimum(squares, limit).sum(-1) + tension
        return RansacViews(pose, measurement.seen & (squares <= limit), squares, cost)

    def near_fits(self, start: SE3) -> SE3:
        """Candidate poses of each view, (2, n): `start`, and the fit to all points from there."""
        fitted = self.fit(start, self.measurement.seen, _FIRST_STEPS)
        return _reshape_poses(concatenate([start, fitted]), (2, len(start)))

    def subset_fits(self, guess: SE3) -> SE3:
        """Candidate poses of each view, (m, n): `near_fits`, and fits to subsets of the points."""
        measurement, fits = self.measurement, [_reshape_poses(self.near_fits(guess), (-1,))]
        subsets = _subsets(measurement.seen)
        for chunk in _chunks(*subsets.shape):
            points = subsets[chunk].reshape(-1, subsets.shape[-1])
            rows = _repeat_rows(len(guess), len(subsets[chunk]))
            start = guess[rows]
            is_many, is_flat = points.shape[-1] > FEW_POINTS, dimension(measurement.points_in_target) < 3
            if isinstance(measurement, PixelMeasurement) and is_many and is_flat:
                start = _closed_form(measurement, points, self.camera, guess)
            fits.append(take(self, rows).fit(start, points, _FIRST_STEPS))
        return _reshape_poses(concatenate(fits), (-1, len(guess)))

    def largest_agreement(self, poses: SE3, limit: float) -> RansacViews:
        """Select each view's best candidate pose, (m, n), and refit it to its inliers until convergence.

        The first candidate is refitted as well, and the result with the lower cost is returned; see `agreement` for
        the limit.
        """
        m, n = poses.translation.shape[:2]
        costs = []
        for chunk in _chunks(m, *self.measurement.seen.shape):
            candidates = _reshape_poses(poses[chunk], (-1,))
            costs.append(
                take(self, _repeat_rows(n, len(candidates) // n)).agreement(candidates, limit).cost.reshape(-1, n)
            )
        cost = np.concatenate(costs)
        best = poses[np.argmin(np.where(np.isnan(cost), np.inf, cost), axis=0), np.arange(n)]
        both = take(self, _repeat_rows(n, 2))._refit(concatenate([best, poses[0]]), limit)
        return take(both, slice(0, n)).better(take(both, slice(n, None)))

    def _refit(self, pose: SE3, limit: float) -> RansacViews:
        """Alternate between the fit to the inliers and their selection, for each view until its inliers are stable."""
        agreement = self.agreement(pose, limit)
        moving, source = np.arange(len(pose)), np.arange(len(pose))
        for _ in range(_FIT_ROUNDS):
            views, current = take(self, moving), take(agreement, moving)
            refitted = views.agreement(views.fit(current.camera_from_target, current.points, _FIT_STEPS), limit).better(
                current
            )
            rows = source.copy()
            rows[moving] = len(source) + np.arange(len(moving))
            agreement = take(concatenate([agreement, refitted]), rows)
            moving = moving[np.any(refitted.points != current.points, axis=-1)]
            if not len(moving):
                break
        return agreement


def _subsets(is_visible: BoolArray) -> BoolArray:
    """Subsets of each view's points (n, p) as masks, (m, n, p): random ones, or all but one or two of few points."""
    n, p = is_visible.shape
    if p <= FEW_POINTS:
        counts = range(1, min(_MOST_EXCLUDED, p - 1) + 1)
        kept = [~np.isin(np.arange(p), excluded) for count in counts for excluded in combinations(range(p), count)]
        return np.asarray(is_visible & np.array(kept, dtype=bool).reshape(-1, 1, p))
    order = np.where(is_visible, np.random.default_rng(_SEED).random((_DRAWS, n, p)), 2.0)
    subsets = np.zeros(order.shape, dtype=bool)
    np.put_along_axis(subsets, np.argpartition(order, _DRAWN_POINTS - 1, axis=-1)[..., :_DRAWN_POINTS], True, axis=-1)
    return subsets & is_visible


def _closed_form(measurement: PixelMeasurement, subsets: BoolArray, camera: Camera | None, start: SE3) -> SE3:
    """Closed-form poses, (k n,), from k subsets of points of each view, (k n, p); `start` if there is none."""
    assert camera is not None
    bearings, valid = camera.undistort(measurement.pixels)
    rows = _repeat_rows(len(start), len(subsets) // len(start))
    seen = subsets & valid[rows]
    measured = BearingMeasurement(
        measurement.points_in_target,
        np.where(seen[..., None], bearings[rows], 0.0),
        np.where(seen, float(camera.focal.mean()), 0.0),
    )
    poses = view_poses(measurement.points_in_target, measured.bearings_in_camera, seen, measured)
    return choose_entries(poses.has_pose, poses.camera_from_target[:, 0], start[rows])


def _chunks(count: int, views: int, points: int) -> Iterator[slice]:
    """Slices over hypotheses, small enough for the arrays of their views and points to fit into memory."""
    size = max(1, _CHUNK_POINTS // max(views * points, 1))
    return (slice(start, min(start + size, count)) for start in range(0, count, size))


def _repeat_rows(views: int, times: int) -> IntArray:
    """Rows of all views, repeated the given number of times."""
    return np.tile(np.arange(views, dtype=np.int64), times)


def _reshape_poses(poses: SE3, shape: tuple[int, ...]) -> SE3:
    return SE3(poses.rotation.reshape(*shape, 3, 3), poses.translation.reshape(*shape, 3))
