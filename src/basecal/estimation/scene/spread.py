"""Covariance of a scene: the model's covariance, widened if a block jackknife shows a larger one.

Errors of features are correlated between neighbouring points and with the viewing direction. Therefore clusters of
points and folds of views are left out, to first order about the optimum. Ten blocks determine the mean of all variances
well, but not the variance of a single direction. The jackknife covariance, in sigmas of the model, is therefore shrunk
towards its mean variance. Sources: Efron 1982 (jackknife); Ledoit & Wolf 2004 (shrinkage).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.cluster.vq import kmeans2

from basecal.estimation.scene.adjust import SceneFit
from basecal.geometry import Array, BoolArray

_CLUSTERS = 10  # clusters of points
_FOLDS = 10  # folds of views
_SEED = 1  # any seed works


def scene_covariance(fit: SceneFit) -> Array:
    """Covariance of all columns except stop errors, (q, q)."""
    width = fit.columns.errors.start
    model_covariance = np.linalg.inv(fit.information)[:width, :width]
    root = np.linalg.cholesky(model_covariance)
    for parts in (_point_clusters(fit), _view_folds(fit)):
        moves = np.linalg.solve(root, np.array([_jackknife_step(fit, part)[:width] for part in parts]).T)
        share, axes = np.linalg.eigh(_jackknife(moves.T))
        root = root @ axes * np.sqrt(np.maximum(share, 1.0))
    return np.asarray(root @ root.T)


def widening_factor(fit: SceneFit) -> float:
    """Factor by which to increase the sigma of image points, so that the mean variance equals `scene_covariance`."""
    width = fit.columns.errors.start
    model_covariance = np.linalg.inv(fit.information)[:width, :width]
    return float(np.sqrt(np.trace(np.linalg.solve(model_covariance, scene_covariance(fit))) / width))


def _point_clusters(fit: SceneFit) -> list[BoolArray]:
    """Masks of the image points of each cluster of points, (n,) each."""
    centred = (fit.state.points - np.median(fit.state.points, axis=0)) / np.maximum(fit.state.points.std(0), 1e-9)
    _, label = kmeans2(np.clip(centred, -3, 3), _CLUSTERS, minit="++", rng=np.random.default_rng(_SEED))
    return [label[fit.tracks.point] == k for k in np.unique(label)]


def _view_folds(fit: SceneFit) -> list[BoolArray]:
    """Masks of the image points of each fold of views, (n,) each; folds are interleaved in time."""
    fold = np.arange(len(fit.views)) % min(_FOLDS, len(fit.views))
    return [fold[fit.tracks.view] == k for k in np.unique(fold)]


def _jackknife_step(fit: SceneFit, left_out: BoolArray) -> Array:
    """Change of the optimum if some image points are left out, to first order, (m,)."""
    rest, kept_points = fit.tracks.take(~left_out, min_views=2)
    pixels, prior = replace(fit, tracks=rest).linearise(fit.state.with_points(fit.state.points[kept_points]))
    return np.asarray(-np.linalg.solve(pixels.hessian + prior.hessian, pixels.gradient + prior.gradient))


def _jackknife(moves: Array) -> Array:
    """Jackknife covariance (q, q), shrunk towards its mean variance, from changes of the optimum, (n, q).

    Row i of `moves` is the change of q unknowns if part i of n is left out.
    """
    count, width = moves.shape
    deviations = (moves - moves.mean(0)) * np.sqrt(count - 1)
    covariance = deviations.T @ deviations / count
    target = np.trace(covariance) / width * np.eye(width)
    sampling_variance = np.mean(np.sum(deviations**2, 1) ** 2) / count - np.sum(covariance**2) / count
    share = min(sampling_variance / max(np.sum((covariance - target) ** 2), 1e-300), 1.0)
    return np.asarray(share * target + (1 - share) * covariance)
