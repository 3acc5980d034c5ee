"""Conversion of numbers, poses and sigmas to short plain data."""

from __future__ import annotations

from typing import Any

import numpy as np

from basecal.geometry import SE3, Array

_QUATERNION_DIGITS = 15


def numbers(array: Array) -> Any:
    """Convert an array to nested lists of floats without negative zeros."""
    return (np.asarray(array, dtype=np.float64) + 0.0).tolist()


def pose_dict(pose: SE3) -> dict[str, Any]:
    """Convert a transform to exact `t_m` and `q_xyzw` of 15 decimals."""
    return {"t_m": numbers(pose.translation), "q_xyzw": numbers(np.round(pose.quaternion, _QUATERNION_DIGITS))}


def one_or_all(values: Array) -> Any:
    """One number if all values are equal, otherwise the list."""
    return float(values[0]) if len(values) and np.all(values == values[0]) else numbers(values)


def sigma_dict(sigma: Array) -> dict[str, Any]:
    """Convert (6,) sigmas [m, rad] to `sigma_t_m` and `sigma_r_rad`."""
    return {"sigma_t_m": one_or_all(sigma[:3]), "sigma_r_rad": one_or_all(sigma[3:])}
