"""Shape of a target: a board is bowed, or points on a body deviate from their stated positions.

A bow moves the corners of an obliquely viewed board by a pixel and more. The bow is equal in all views, so that lens
and mounts compensate it. On a three-dimensional body each point has its own error. As the body rotates, other points
become visible, and their errors resemble errors of the arm. Translation and rotation of the whole body belong to its
mount. Source: docs/mathematics.md (5.5).
"""

from __future__ import annotations

import numpy as np

from basecal.effects.faces.effect import Effect, TargetParameter, Words
from basecal.fields.digits import two_digits
from basecal.geometry import Array
from basecal.geometry.rotation import cross_matrix
from basecal.numerics.spectral import dimension, least_norm, principal_axes

_BOW = 3e-3  # one sigma of a coefficient, of the half size: the middle of the 0.1 to 0.6 % of printed boards
_POINT = 5e-3  # one sigma of a coordinate, of the half size, of bodies of printed plastic and assembled ones
_THIN = 0.05  # thickness as a share of the extent, above which a target is a body, not a bowed board
_STEEP = 0.9  # component of the normal above which the target's x axis cannot define an axis of the plane
_RIGID = 6  # rigid-body degrees of freedom, which do not change the shape
_LEAST_M = 1e-4  # [m] largest deviation that is negligible
_MOST_SIGMAS = 3.0  # of a typical target; above it another error is likely
BOW_COEFFICIENTS = 3


def is_flat(points_in_target: Array) -> bool:
    """Whether points, (p, 3), lie in a plane, within the bow of a board."""
    return dimension(points_in_target, _THIN) < 3


def has_area(points_in_target: Array) -> bool:
    """Whether points, (p, 3), are not collinear."""
    return dimension(points_in_target, _THIN) > 1


def unit_shifts(points_in_target: Array) -> Array:
    """Shifts of a target's points, (p, 3) [m], by one sigma of each coefficient of its shape, (p, 3, k) [m]."""
    return unit_bow(points_in_target) if is_flat(points_in_target) else _unit_point_shifts(points_in_target)


def unit_bow(points_in_target: Array) -> Array:
    """Shifts of a board's points, (p, 3) [m], by each coefficient of its bow, (p, 3, 3) [m per sigma].

    The coefficients are those of u^2, u v and v^2, with u and v from -1 to 1 over the half size.
    """
    plane, normal = _plane(points_in_target)
    half = float(np.abs(plane).max())
    u, v = (plane / half).T
    heights = _BOW * half * np.column_stack([u * u, u * v, v * v])
    return np.asarray(heights[:, None, :] * normal[None, :, None])


def _unit_point_shifts(points_in_target: Array) -> Array:
    """Shifts of points by each coordinate of each point, with rigid motions projected out, (p, 3, 3p) [m per sigma]."""
    centred = points_in_target - points_in_target.mean(0)
    count = len(points_in_target)
    rigid = np.concatenate([np.broadcast_to(np.eye(3), (count, 3, 3)), cross_matrix(centred)], -1).reshape(3 * count, 6)
    basis = np.linalg.qr(rigid)[0]
    half = float(np.linalg.norm(centred, axis=1).max())
    return np.asarray(_POINT * half * (np.eye(3 * count) - basis @ basis.T)).reshape(count, 3, 3 * count)


def _plane(points_in_target: Array) -> tuple[Array, Array]:
    """Coordinates of points in their plane from their mean, (p, 2) [m], and the plane's unit normal, (3,).

    The axes in the plane follow the target's axes, so that they do not depend on the arrangement of the points.
    """
    centred = points_in_target - points_in_target.mean(0)
    normal = principal_axes(centred).axes[:, 2]
    normal = np.copysign(1.0, normal[np.argmax(np.abs(normal))]) * normal
    first = np.eye(3)[0 if abs(normal[0]) < _STEEP else 1]
    u = first - (first @ normal) * normal
    u /= np.linalg.norm(u)
    return centred @ np.column_stack([u, np.cross(normal, u)]), normal


def bow_height_m(points_in_target: Array, bow: Array) -> float:
    """Largest distance of the points of a bowed board from their best-fit plane [m]."""
    plane, normal = _plane(points_in_target)
    heights = (unit_bow(points_in_target) @ bow) @ normal
    rows = np.column_stack([plane, np.ones(len(plane))])
    return float(np.abs(heights - rows @ least_norm(rows, heights)).max())


def point_shifts_m(points_in_target: Array, shape: Array) -> Array:
    """Distance of each point of a target from its stated position, (p,) [m]."""
    return np.asarray(np.linalg.norm(unit_shifts(points_in_target) @ shape, axis=1))


def freedoms(points_in_target: Array, shape: Array) -> int:
    """Number of independent coefficients of a shape."""
    return len(shape) if is_flat(points_in_target) else len(shape) - _RIGID


def words(target: str, points_in_target: Array, shape: Array) -> Words | None:
    """Describe the deviation of a target's points, and whether it is plausible for a target; None if negligible."""
    if is_flat(points_in_target):
        size_m, sigmas = bow_height_m(points_in_target, shape), float(np.abs(shape).max())
        what, usual = f"{target} is not flat: its points are {{}} from their plane.", "the usual bow of printed boards"
        do = "Use a board on glass or aluminium."
    else:
        size_m = float(point_shifts_m(points_in_target, shape).max())
        sigmas = float(np.sqrt(np.sum(shape**2) / freedoms(points_in_target, shape)))
        what, usual = f"Points of {target} are {{}} from their stated positions.", "the usual tolerance of targets"
        do = "Measure the points, and state them."
    if size_m < _LEAST_M and sigmas < _MOST_SIGMAS:
        return None
    what = what.format(f"up to {two_digits(1e3 * size_m)} mm")
    if sigmas <= _MOST_SIGMAS:
        return Words("board-shape", what, (do,), "The answer contains the shape.", "info")
    do = "Check the stated points, the lens model and the target's size."
    return Words("board-shape", what, (do,), f"That is more than {usual}.")


EFFECT = Effect(
    "target_shape",
    target=TargetParameter(
        unit_shifts,
        "printed boards are bowed by 0.1 to 0.6 % of the half size, printed bodies are made to 0.5 %",
        words,
    ),
    elsewhere={"statement": "basecal.cell.targets.points: points as measured"},
    absent={
        "unknown": "the coefficients are random effects under their prior",
        "candidate": "the shape is estimated from the start if pixel noise is unstated",
        "map": "no target is used at the task",
        "fault": "images are rendered of planes; tests bend simulated points",
    },
)
