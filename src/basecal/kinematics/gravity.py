"""Gravity torques of an arm's joints. Source: docs/mathematics.md (9.2)."""

from __future__ import annotations

import numpy as np

from basecal.errors import InputError
from basecal.geometry import Array
from basecal.kinematics.chain import SerialChain

STANDARD_GRAVITY = 9.80665  # [m/s^2]
_LEAST_TORQUE_NM = 1e-9  # smaller torques are rounding, such as for an axis along gravity


def gravity_torques(chain: SerialChain, joints: Array) -> Array:
    """Torque of gravity about each joint axis, (..., n) [Nm].

    Args:
        chain: The arm, with masses and the direction of gravity.
        joints: (..., n) [rad].

    Raises:
        InputError: if the chain has no masses.

    Source: the virtual work of the weights; Lynch & Park 2017, "Modern Robotics", 8.1.
    """
    if chain.masses is None:
        raise InputError("gravity torques need masses: add <inertial> elements to the links of the URDF")
    frames = chain.joint_frames(joints)
    rotation, places = np.moveaxis(frames.rotation, 0, -3), np.moveaxis(frames.translation, 0, -2)
    centres = places + np.einsum("...nij,nj->...ni", rotation, chain.masses.centres)
    axes = np.einsum("...nij,nj->...ni", rotation, chain.axes)
    moments = (chain.masses.kg[:, None] * centres)[..., ::-1, :]
    moment_beyond = np.cumsum(moments, axis=-2)[..., ::-1, :]
    mass_beyond = np.cumsum(chain.masses.kg[::-1])[::-1, None]
    lever = moment_beyond - mass_beyond * places
    torque: Array = STANDARD_GRAVITY * np.einsum("...i,...i->...", axes, np.cross(lever, chain.masses.down))
    return np.where(np.abs(torque) < _LEAST_TORQUE_NM, 0.0, torque)
