"""The covariance of a scene: that of the model, or where parts of the data contradict one another more, of these.

Errors of features are correlated: between neighbouring points, and with the direction of view. So points are left
out by clusters and views by folds, to first order about the optimum. Ten parts determine the mean of all variances,
and hardly that of a direction. Their covariance in sigmas of the model is shrunk to its mean, as far as chance goes.
Sources: Efron 1982 (jackknife); Ledoit & Wolf 2004 (shrinkage).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.cluster.vq import kmeans2

from basecal.estimation.scene.adjust import SceneFit
from basecal.geometry import Array, BoolArray

_CLUSTERS = 10  # of points
_FOLDS = 10  # of views
_SEED = 1  # any other would do


def scene_covariance(fit: SceneFit) -> Array:
    """Covariance of all columns that are no errors of stops, (q, q)."""
    own = fit.columns.errors.start
    of_model = np.linalg.inv(fit.information)[:own, :own]
    root = np.linalg.cholesky(of_model)
    for parts in (_point_clusters(fit), _view_folds(fit)):
        moves = np.linalg.solve(root, np.array([_jackknife_step(fit, part)[:own] for part in parts]).T)
        share, axes = np.linalg.eigh(_jackknife(moves.T))
        root = root @ axes * np.sqrt(np.maximum(share, 1.0))
    return np.asarray(root @ root.T)


def widening(fit: SceneFit) -> float:
    """Factor of sigmas of image points by which the covariance is that of `scene_covariance` on average."""
    own = fit.columns.errors.start
    of_model = np.linalg.inv(fit.information)[:own, :own]
    return float(np.sqrt(np.trace(np.linalg.solve(of_model, scene_covariance(fit))) / own))


def _point_clusters(fit: SceneFit) -> list[BoolArray]:
    """Which image points are of each cluster of points."""
    centred = (fit.state.points - np.median(fit.state.points, axis=0)) / np.maximum(fit.state.points.std(0), 1e-9)
    _, label = kmeans2(np.clip(centred, -3, 3), _CLUSTERS, minit="++", rng=np.random.default_rng(_SEED))
    return [label[fit.tracks.point] == k for k in np.unique(label)]


def _view_folds(fit: SceneFit) -> list[BoolArray]:
    """Which image points are of each fold of views, spread over time."""
    fold = np.arange(len(fit.views)) % min(_FOLDS, len(fit.views))
    return [fold[fit.tracks.view] == k for k in np.unique(fold)]


def _jackknife_step(fit: SceneFit, left_out: BoolArray) -> Array:
    """How the optimum moves without some image points, to first order, (m,)."""
    rest, old = fit.tracks.take(~left_out, min_views=2)
    pixels, prior = replace(fit, tracks=rest).linearise(fit.state.with_points(fit.state.points[old]))
    return np.asarray(-np.linalg.solve(pixels.hessian + prior.hessian, pixels.gradient + prior.gradient))


def _jackknife(moves: Array) -> Array:
    """Covariance (q, q) by what q unknowns move if each of n parts is left out, (n, q), shrunk to its mean variance."""
    count, width = moves.shape
    about = (moves - moves.mean(0)) * np.sqrt(count - 1)
    found = about.T @ about / count
    equal = np.trace(found) / width * np.eye(width)
    by_chance = np.mean(np.sum(about**2, 1) ** 2) / count - np.sum(found**2) / count
    share = min(by_chance / max(np.sum((found - equal) ** 2), 1e-300), 1.0)
    return np.asarray(share * equal + (1 - share) * found)
