"""Priors of the unknowns of a scene: stated transforms and lenses, and errors of stops."""

from __future__ import annotations

import numpy as np

from basecal.cell import Intrinsics
from basecal.estimation.least_squares.normal_equations import prior_residual
from basecal.estimation.scene.state import Columns, SceneState
from basecal.estimation.scene.views import SceneViews
from basecal.geometry import Array, Camera
from basecal.numerics.levenberg_marquardt import Quadratic

FOCAL_SHARE = 0.1  # [1] sigma of a free focal length about its guess; assumed
_CENTER_SHARE = 0.03  # [1] of the image size, sigma of a free principal point; assumed
_ASPECT_SHARE = 1e-3  # [1] sigma of fy / fx: pixels of today's sensors are square; assumed
_TERM = 1.0  # [1] sigma of a distortion term of which nothing is known; assumed


def prior_information(
    views: SceneViews, state: SceneState, columns: Columns, sigmas: Array, guesses: tuple[Camera, ...]
) -> Quadratic:
    """Prior information of all unknowns.

    Args:
        views: The views, with what is known of mounts, bases and lenses.
        state: The state.
        columns: Of the unknowns.
        sigmas: (s, 6) of the errors of stops [m, rad].
        guesses: Lenses about which free ones are expected.
    """
    width = columns.errors.stop
    gradient, information, cost = np.zeros(width), np.zeros((width, width)), 0.0
    for residual, jacobian, where in _residuals(views, state, columns, guesses):
        gradient[where] += jacobian.T @ residual
        information[where, where] += jacobian.T @ jacobian
        cost += float(residual @ residual)
    scaled = (state.errors / sigmas**2).ravel()
    gradient[columns.errors] = scaled
    at = np.arange(columns.errors.start, columns.errors.stop)
    information[at, at] = (1 / sigmas**2).ravel()
    return Quadratic(np.array(cost + scaled @ state.errors.ravel()), gradient, information)


def _residuals(
    views: SceneViews, state: SceneState, columns: Columns, guesses: tuple[Camera, ...]
) -> list[tuple[Array, Array, slice]]:
    """Residuals in sigmas, their derivatives and columns, of all but the errors of stops."""
    found = []
    mounts = tuple(camera.mount for camera in views.cameras)
    stacks = (mounts, state.mounts, columns.mounts), (views.bases, state.bases, columns.bases)
    places = [(known, values[k], where[k]) for all_known, values, where in stacks for k, known in enumerate(all_known)]
    for known, value, where in places:
        if where is not None and known.status == "prior":
            found.append((*prior_residual(known, value), where))
    for camera, lens, guess, where in zip(views.cameras, state.lenses, guesses, columns.lenses, strict=True):
        if where is not None:
            found.append((*_lens_residual(camera.lens, lens, guess), where))
    return found


def _lens_residual(intrinsics: Intrinsics, value: Camera, guess: Camera) -> tuple[Array, Array]:
    """A stated lens by its sigmas; a free one by what lenses have."""
    if intrinsics.status == "prior" and intrinsics.camera is not None and intrinsics.sigma is not None:
        return (value.parameters - intrinsics.camera.parameters) / intrinsics.sigma, np.diag(1 / intrinsics.sigma)
    count = len(value.parameters)
    focal = float(guess.focal.mean())
    width, height = guess.size_px or (2 * focal, 2 * focal)
    terms = np.where(np.isfinite(guess.term_sigmas), guess.term_sigmas, _TERM)
    rows = np.eye(count)
    rows[0] *= 1 / (FOCAL_SHARE * focal)
    rows[1] = (rows[1] - np.eye(count)[0]) / (_ASPECT_SHARE * focal)
    rows[2:4] /= _CENTER_SHARE * np.array([[width], [height]])
    rows[4:] /= terms[:, None]
    expected = np.concatenate([[focal, focal], guess.center, np.zeros(count - 4)])
    return rows @ (value.parameters - expected), rows
