"""Residuals that depend on the position in the image: distortion that the lens model cannot represent.

Each view has its own pose here, and the parameters of the lens model are projected out. The remaining residuals contain
no effect of robots or mounts. Further terms are estimated from each view. Their mean is tested against their scatter.
Points of one view share errors of the board and of blur, and are not independent. Source: Fisher 1925 (analysis of
variance), McCullagh & Nelder 1989 (dispersion).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from basecal.accuracy.covariance.widening import state_step
from basecal.accuracy.model_comparison.nested_models import SINGLE_LEVEL, compare_nested_models
from basecal.accuracy.residuals.fit import single_view_pose
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_from
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import SE3, Array, Camera
from basecal.numerics.spectral import VIEW_ROUNDING, spectrum

_TERM_COUNT = 5  # radial s^4, and s and s^2 along each image axis, with s the squared radius
_TERM_FAMILIES = (0,), (1, 2, 3, 4)  # tested separately: those along the axes are coupled with centre and mount
_FEWEST_VIEWS = 10  # views, which determine their scatter to about a fifth
_CHUNK_VIEWS = 400  # views per batch of derivatives: more exceed the cache


@dataclass(frozen=True, eq=False)
class LensStructure:
    """Dependence of a camera's residuals on the position in the image.

    Attributes:
        camera: Name of the camera.
        rms_px: RMS of the terms over all points [px].
        chance: Probability that noise alone gives terms as large.
        moved: Step of the answer's columns if the terms are removed from the pixels, (p,).
    """

    camera: str
    rms_px: float
    chance: float
    moved: Array


def lens_structures(solution: Solution, settings: Settings) -> list[LensStructure]:
    """Lens structure of each camera whose residuals depend significantly on the position in the image."""
    if not solution.converged:
        return []
    cameras = sorted({g.camera for g in solution.problem.groups if isinstance(g.measurement, PixelMeasurement)})
    found = [_camera_structure(solution, name, settings) for name in cameras]
    return [each for each in found if each is not None]


def _camera_structure(solution: Solution, name: str, settings: Settings) -> LensStructure | None:
    camera = solution.state.cameras[name]
    seen = [each for g in solution.problem.groups if g.camera == name for each in _single_view_poses(solution, g)]
    if sum(len(alone) for _, alone in seen) < _FEWEST_VIEWS:
        return None
    of_groups = [_project(measurement, alone, camera) for measurement, alone in seen]
    projected = _Projected(*map(_stack_views, zip(*of_groups, strict=True)))
    size, chance = _choose_terms(projected.residual, projected.of_lens, projected.of_terms)
    if not np.any(size):
        return None
    shift = projected.in_pixels @ size
    rms_px = float(np.sqrt(np.mean(shift[np.any(projected.in_pixels, axis=-1)] ** 2)))
    return LensStructure(name, rms_px, chance, _answer_step(solution, name, size, settings))


def _choose_terms(residual: Array, lens_columns: Array, term_columns: Array) -> tuple[Array, float]:
    """Sizes of the significant terms, (q,), and the smallest p-value; families are added in order of significance."""
    size, chance, used, open_families = np.zeros(_TERM_COUNT), 1.0, np.zeros(0, dtype=np.int64), list(_TERM_FAMILIES)
    while open_families:
        known = np.concatenate([lens_columns, term_columns[..., used]], axis=-1)
        tried = [_estimate_sizes(residual, known, term_columns[..., list(family)]) for family in open_families]
        best = min(range(len(tried)), key=lambda k: tried[k][1])
        if tried[best][1] > SINGLE_LEVEL / len(_TERM_FAMILIES):
            break
        chance = min(chance, tried[best][1])
        used = np.append(used, open_families.pop(best))
        size[used] = _estimate_sizes(residual, lens_columns, term_columns[..., used])[0]
    return size, chance


def _estimate_sizes(residual: Array, known_columns: Array, columns: Array) -> tuple[Array, float]:
    """Sizes of columns, (k,), with known columns projected out, and their p-value; columns are (n, r, k)."""
    flat = known_columns.reshape(-1, known_columns.shape[-1])
    inverse = spectrum(flat.T @ flat).inverse
    left = residual - known_columns @ (inverse @ (flat.T @ residual.ravel()))
    columns = columns - known_columns @ (inverse @ (flat.T @ columns.reshape(len(flat), -1)))
    transposed = columns.mT
    scores, information = (transposed @ left[..., None])[..., 0], transposed @ columns
    size = spectrum(information.sum(0)).inverse @ scores.sum(0)
    return size, _chance(scores, information, size)


def _chance(scores: Array, information: Array, size: Array) -> float:
    """P-value of Fisher's F test of the shared sizes against the scatter of the sizes of single views.

    Args:
        scores: Scores of the terms of each view, (n, q).
        information: Information of each view about the terms, (n, q, q).
        size: Sizes of the terms from all views, (q,).
    """
    of_views = spectrum(information, VIEW_ROUNDING)
    freedoms = int(of_views.rank.sum()) - len(size)
    shared = float(scores.sum(0) @ size)
    scatter = float(of_views.squared_mahalanobis(scores).sum()) - shared
    if freedoms <= 0 or scatter <= 0:
        return 1.0
    return compare_nested_models(shared / (scatter / freedoms), len(size), noise_freedoms=freedoms).chance


def _stack_views(arrays: tuple[Array, ...]) -> Array:
    """Stack the views of several targets, (n, r, ...) each, padded with zeros to the largest number of points."""
    rows = max(array.shape[1] for array in arrays)
    filled = [np.pad(a, [(0, 0), (0, rows - a.shape[1]), *[(0, 0)] * (a.ndim - 2)]) for a in arrays]
    return np.concatenate(filled)


def _single_view_poses(solution: Solution, group: ViewGroup) -> list[tuple[PixelMeasurement, SE3]]:
    """Views of a group that determine a pose on their own, with these poses, in batches that fit the cache."""
    measurement = group.measurement
    if not isinstance(measurement, PixelMeasurement):
        return []
    predicted = solution.state.camera_from_target(group, solution.problem.stops)
    alone, enough = single_view_pose(solution.state, group, predicted)
    rows = np.flatnonzero(enough)
    parts = (rows[at : at + _CHUNK_VIEWS] for at in range(0, len(rows), _CHUNK_VIEWS))
    return [(measurement.take(part), alone[part]) for part in parts]


class _Projected(NamedTuple):
    """Weighted views of a lens, with each view's own pose projected out.

    Attributes:
        residual: Residuals, (n, r).
        of_lens: Columns of the lens parameters, (n, r, k).
        of_terms: Columns of the terms that the lens model lacks, (n, r, q).
        in_pixels: Columns of these terms, neither weighted nor projected, (n, r, q) [px].
    """

    residual: Array
    of_lens: Array
    of_terms: Array
    in_pixels: Array


def _project(measurement: PixelMeasurement, poses: SE3, camera: Camera) -> _Projected:
    off, by_pose, by_lens = measurement.tangent_rows(poses, camera, with_lens=True)
    assert by_lens is not None
    weight = np.where(np.isnan(off).any(-1), 0.0, measurement.weight)
    by_terms = np.where(weight[..., None, None] > 0, _term_derivatives(camera, measurement.camera_points(poses)), 0.0)
    columns = np.concatenate([by_pose, by_lens, by_terms], axis=-1)
    weighted = np.nan_to_num(columns) * weight[..., None, None]
    residual = -np.nan_to_num(off) * weight[..., None]
    n, r = len(poses), 2 * measurement.pixels.shape[1]
    basis, _ = np.linalg.qr(weighted[..., :6].reshape(n, r, 6))
    rest = np.concatenate([residual.reshape(n, r, 1), weighted[..., 6:].reshape(n, r, -1)], axis=-1)
    rest = rest - basis @ (basis.mT @ rest)
    return _Projected(
        rest[..., 0], rest[..., 1:-_TERM_COUNT], rest[..., -_TERM_COUNT:], by_terms.reshape(n, r, _TERM_COUNT)
    )


def _term_derivatives(camera: Camera, p_in_camera: Array) -> Array:
    """Derivatives of pixels with respect to the tested terms, (n, p, 2, q) [px]; no lens model has all of them."""
    with np.errstate(all="ignore"):
        plane = p_in_camera[..., :2] / p_in_camera[..., 2:]
    s = np.einsum("...i,...i->...", plane, plane)
    zero = np.zeros_like(s)
    across, along = (np.stack([np.stack([s**k, zero], -1) for k in (1, 2)], -1),
                     np.stack([np.stack([zero, s**k], -1) for k in (1, 2)], -1))  # fmt: skip
    radial = (plane * s[..., None] ** 4)[..., None]
    derivatives: Array = np.concatenate([radial, across, along], axis=-1) * camera.focal[:, None]
    return np.nan_to_num(derivatives)


def _answer_step(solution: Solution, name: str, size: Array, settings: Settings) -> Array:
    """Step of the answer if the terms are removed from the pixels, (p,); zero if the solve does not converge."""
    groups = []
    for group in solution.problem.groups:
        measurement = group.measurement
        if group.camera == name and isinstance(measurement, PixelMeasurement):
            predicted = solution.state.camera_from_target(group, solution.problem.stops)
            shift = _term_derivatives(solution.state.cameras[name], measurement.camera_points(predicted)) @ size
            group = replace(group, measurement=replace(measurement, pixels=measurement.pixels - shift))
        groups.append(group)
    problem = solution.problem.with_groups(groups)
    after = solve_from(replace(problem, held=True), solution.state, replace(settings, robot_noise="stated"))
    return state_step(problem, solution.state, after.state) if after.converged else np.zeros(problem.width)
