"""The paper's closed form: one robot shifts an LED in front of a camera at rest.

An LED G on the hand robot moves along three directions while the camera C is at rest. `camera_from_led` follows in
closed form from the shifts of the LED's image, and the base from this and the two robots' poses. Numbers in brackets
are the paper's equations. Image coordinates are undistorted pixels minus the principal point, v down.

Source: "Base Calibration for Dual Robot System", section 2, eqs. (1)-(16). We differ in one point: real shifts are
neither equal nor along the axes. The measured 3x3 matrix of shifts therefore replaces the paper's L times the identity.
With that matrix every formula is the paper's: docs/mathematics.md (1.1)-(1.7).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.errors import NotConverged, NotObservable
from basecal.geometry import SE3, Array
from basecal.geometry.rotation import cross_matrix, nearest_rotation
from basecal.numerics.spectral import principal_axes, pseudo_inverse

_FLAT_SHARE = 1e-3  # third singular value of the shifts over the first: below, they lie in a plane
_NEARLY_PARALLEL_RAD = 1e-4  # [rad] between two rows: below, their plane is accurate to fewer than twelve digits
_NEWTON_STEPS = 100  # most Newton steps
_NEWTON_TOLERANCE = 1e-14  # rounding of a rotation


@dataclass(frozen=True, eq=False)
class ShiftEstimate:
    """Estimate of one station.

    Attributes:
        raw_rotation: (..., 3, 3) `camera_from_led` of eq. (8): rows k1, k2 and k3 = k1 x k2, not yet orthonormal.
        camera_from_light: (...,) orthonormalised rotation, with the translation of eq. (9).
    """

    raw_rotation: Array
    camera_from_led: SE3


def image_gradient(image_shifts: Array, shifts_in_led: Array) -> Array:
    """Derivative of the image point with respect to the LED's position: rows (du/dp, dv/dp), (..., 2, 3) [px/m].

    Args:
        image_shifts: (..., n, 2) [px] shifts of the image, n >= 3.
        shifts_in_led: (n, 3) [m] shifts of the LED along G's axes; least squares if n > 3.

    Raises:
        NotObservable: if the shifts lie in a plane.
    """
    if principal_axes(shifts_in_led, _FLAT_SHARE).dimension < 3:
        raise NotObservable("the shifts of the LED lie in one plane: add a shift out of this plane")
    return np.asarray(np.swapaxes(pseudo_inverse(shifts_in_led) @ image_shifts, -1, -2))


def estimate(led_px: Array, gradient: Array, focal_px: Array) -> ShiftEstimate:
    """`camera_from_led` in closed form, eqs. (7)-(9).

    Args:
        led_px: (..., 2) [px] image point of the LED before the shifts.
        gradient: (..., 2, 3) [px/m] result of `image_gradient`, with rows (u_x, u_y, u_z) / L and (v_x, v_y, v_z) / L.
        focal_px: (2,) fu and fv [px].

    Returns:
        The estimate, orthonormalised before its use in eq. (10), as in the paper.
    """
    per_length = np.linalg.norm(gradient, axis=-1)  # (l_u, l_v) / L, eq. (7)
    k1, k2 = gradient[..., 0, :] / per_length[..., :1], gradient[..., 1, :] / per_length[..., 1:]
    raw = np.stack([k1, k2, np.cross(k1, k2)], axis=-2)  # eq. (8)
    depth = np.mean(focal_px / per_length, axis=-1)  # eq. (9), t_z
    t = np.concatenate([led_px * depth[..., None] / focal_px, depth[..., None]], axis=-1)
    return ShiftEstimate(raw, SE3(_nearest_rotations(raw), t))


def _nearest_rotations(raw: Array) -> Array:
    """Nearest rotations to rows k1, k2 of length one and k1 x k2, (..., 3, 3).

    The third row is perpendicular to the others. Therefore k1 and k2 are rotated in their plane, each by half the
    deviation of their angle from 90 deg. Their sum and their difference keep their directions. If k1 and k2 are nearly
    parallel, the result is determined by rounding.
    """
    k1, k2 = raw[..., 0, :], raw[..., 1, :]
    sums, differences = k1 + k2, k1 - k2
    lengths = [np.linalg.norm(each, axis=-1, keepdims=True) for each in (sums, differences)]
    if min(float(each.min(initial=1.0)) for each in lengths) < _NEARLY_PARALLEL_RAD:
        return nearest_rotation(raw)
    a, b = (np.sqrt(0.5) * each / length for each, length in zip((sums, differences), lengths, strict=True))
    return np.stack([a + b, a - b, np.cross(a + b, a - b)], axis=-2)


def base_of_station(eye_base_from_camera: SE3, camera_from_led: SE3, hand_base_from_led: SE3) -> SE3:
    """`eye_base_from_hand_base` of a station, eq. (10)."""
    return eye_base_from_camera @ camera_from_led @ hand_base_from_led.inverse()


def orthonormalise(rows: Array) -> Array:
    """Nearest rotation to three rows, by Newton's method on eqs. (14)-(16).

    The unknowns are r1, r2 and the three multipliers; r3 = r1 x r2. We differ: the paper prints the derivative of
    r1 x r2 with respect to r1, but means its transpose, the cross-product matrix of r2.

    Args:
        rows: (3, 3), k1, k2, k3 of eq. (11).

    Raises:
        NotConverged: if the iteration does not converge; its `state` holds the last unknowns, (9,).
    """
    r = _gram_schmidt(rows)
    x = np.concatenate([r[0], r[1], np.zeros(3)])
    for _ in range(_NEWTON_STEPS):
        step = np.linalg.solve(_newton_matrix(x, rows), -_stationarity(x, rows))
        x = x + step
        if np.abs(step).max() < _NEWTON_TOLERANCE:
            return np.stack([x[:3], x[3:6], np.cross(x[:3], x[3:6])])
    raise NotConverged("the orthonormalisation of eq. (16) did not converge", state=x)


def _gram_schmidt(rows: Array) -> Array:
    r1 = rows[0] / np.linalg.norm(rows[0])
    r2 = rows[1] - (rows[1] @ r1) * r1
    r2 = r2 / np.linalg.norm(r2)
    return np.stack([r1, r2, np.cross(r1, r2)])


def _stationarity(x: Array, rows: Array) -> Array:
    """Residuals of the nine equations (16) at x = (r1, r2, lambda1, lambda2, lambda3), (9,)."""
    r1, r2, (m1, m2, m3) = x[:3], x[3:6], x[6:]
    deviation = np.cross(r1, r2) - rows[2]
    first = r1 - rows[0] + cross_matrix(r2) @ deviation + 0.5 * m1 * r2 + m2 * r1
    second = r2 - rows[1] - cross_matrix(r1) @ deviation + 0.5 * m1 * r1 + m3 * r2
    return np.concatenate([first, second, [r1 @ r2, r1 @ r1 - 1, r2 @ r2 - 1]])


def _newton_matrix(x: Array, rows: Array) -> Array:
    """Derivative of `_stationarity`, (9, 9)."""
    r1, r2, (m1, m2, m3) = x[:3], x[3:6], x[6:]
    deviation = np.cross(r1, r2) - rows[2]
    h1, h2, eye = cross_matrix(r1), cross_matrix(r2), np.eye(3)
    matrix = np.zeros((9, 9))
    matrix[:3, :3] = (1 + m2) * eye - h2 @ h2
    matrix[:3, 3:6] = h2 @ h1 - cross_matrix(deviation) + 0.5 * m1 * eye
    matrix[3:6, :3] = h1 @ h2 + cross_matrix(deviation) + 0.5 * m1 * eye
    matrix[3:6, 3:6] = (1 + m3) * eye - h1 @ h1
    matrix[:3, 6:] = np.stack([0.5 * r2, r1, np.zeros(3)], -1)
    matrix[3:6, 6:] = np.stack([0.5 * r1, np.zeros(3), r2], -1)
    matrix[6, :3], matrix[6, 3:6], matrix[7, :3], matrix[8, 3:6] = r2, r1, 2 * r1, 2 * r2
    return matrix
