"""Franka."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.errors import InputError
from basecal.exchange.controllers.franka import CONVENTION


def test_the_usual_start_of_its_examples():
    """At q = [0, -pi/4, 0, -3 pi/4, 0, pi/2, pi/4] with its hand, by its maker's DH parameters: it points down."""
    reported = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0.3069, 0, 0.4869, 1]
    read = CONVENTION.read(np.array(reported, dtype=float))
    np.testing.assert_allclose(read.translation, [0.3069, 0, 0.4869])
    np.testing.assert_allclose(read.rotation @ [0, 0, 1], [0, 0, -1])


def test_what_its_maker_shows_of_a_robot() -> None:
    """`O_T_EE` of the output of `echo_robot_state` is where the joints beside it put the hand.

    Source: docs of the Franka Control Interface, "Getting started", example output; Craig's DH parameters of "Robot
    and interface specifications", and `F_T_EE` of that output.
    """
    shown = [0.998578, 0.0328747, -0.0417381, 0, 0.0335224, -0.999317, 0.0149157, 0]
    shown += [-0.04122, -0.016294, -0.999017, 0, 0.305468, -0.00814133, 0.483198, 1]
    joints = [0.0167305, -0.762614, -0.0207622, -2.34352, -0.0305686, 1.53975, 0.753872]
    before_m, about_x = [0, 0, 0, 0.0825, -0.0825, 0, 0.088], [0, -1, 1, 1, -1, 1, 1]
    along_m = [0.333, 0, 0.316, 0, 0.384, 0, 0]
    hand = np.eye(4)
    for a, turn, d, q in zip(before_m, about_x, along_m, joints, strict=True):
        x, z = np.eye(4), np.eye(4)
        x[:3, :3], x[0, 3] = Rotation.from_euler("x", 90 * turn, degrees=True).as_matrix(), a
        z[:3, :3], z[2, 3] = Rotation.from_euler("z", q).as_matrix(), d
        hand = hand @ x @ z
    tip = np.eye(4)
    tip[:3, :3], tip[2, 3] = Rotation.from_euler("z", -45, degrees=True).as_matrix(), 0.107 + 0.1034
    np.testing.assert_allclose(CONVENTION.read(np.array(shown)).matrix, hand @ tip, atol=2e-5)


def test_columns_follow_one_another():
    """A quarter turn about z: the first three numbers are where x goes."""
    read = CONVENTION.read(np.array([0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0.1, 0.2, 0.3, 1.0]))
    np.testing.assert_allclose(read.rotation @ [1, 0, 0], [0, 1, 0])


def test_rows_instead_are_an_error():
    """A matrix written row by row has its shift where zeros must be."""
    with pytest.raises(InputError, match="last row"):
        CONVENTION.read(np.array([0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1.0]))
