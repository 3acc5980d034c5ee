"""Tests of the conventions of controllers, each against its maker's document or another program."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.errors import InputError
from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.geometry import SE3


def test_ur_matches_script_manual():
    """The manual states [-2.80856, -0.16202, 0.9] for `rotvec2rpy([3.14, 1.57, 0])`."""
    read = CONTROLLERS["ur"].read(np.array([0.1, 0.2, 0.3, 3.14, 1.57, 0]))
    np.testing.assert_allclose(read.rpy, [-2.80856, -0.16202, 0.9], atol=5e-6)
    np.testing.assert_allclose(read.translation, [0.1, 0.2, 0.3])


def test_ur_lengths_are_in_metres():
    """A shift of half a metre is written as 0.5."""
    np.testing.assert_allclose(CONTROLLERS["ur"].to_numbers(SE3.from_rpy([0, 0, 0], [0.5, 0, 0])), [0.5, 0, 0, 0, 0, 0])


def test_kuka_angles_rotate_about_z_new_y_new_x():
    """A rotates about z, B about the new y and C about the new x, in degrees and mm, as in the manual."""
    read = CONTROLLERS["kuka"].read(np.array([100, 0, -20, 30, 40, 50]))
    np.testing.assert_allclose(
        read.rotation, Rotation.from_euler("ZYX", [30, 40, 50], degrees=True).as_matrix(), atol=1e-14
    )
    np.testing.assert_allclose(read.translation, [0.1, 0, -0.02])


def test_kuka_quaternion_matches_camera_makers_formula():
    """Basler's formula for A, B, C is written out."""
    a, b, c = np.radians([30, 40, 50]) / 2
    x = np.cos(a) * np.cos(b) * np.sin(c) - np.sin(a) * np.sin(b) * np.cos(c)
    w = np.cos(a) * np.cos(b) * np.cos(c) + np.sin(a) * np.sin(b) * np.sin(c)
    quaternion = CONTROLLERS["kuka"].read(np.array([0, 0, 0, 30, 40, 50])).quaternion
    np.testing.assert_allclose(quaternion[[0, 3]], [x, w], atol=1e-14)


def test_kuka_matches_robodk():
    """Both directions of X, Y, Z [mm] and A, B, C [deg] agree with the matrix of `KUKA_2_Pose` of RoboDK 6.0.2."""
    numbers = [100.0, -200.0, 300.0, 25.0, -40.0, 110.0]
    matrix = [
        [0.694272044, -0.402886585, 0.596379685],
        [0.323744371, -0.565246574, -0.758739674],
        [0.64278761, 0.71984631, -0.26200263],
    ]
    read = CONTROLLERS["kuka"].read(np.array(numbers))
    np.testing.assert_allclose(read.rotation, matrix, atol=1e-9)
    np.testing.assert_allclose(read.translation, [0.1, -0.2, 0.3], atol=1e-15)
    np.testing.assert_allclose(CONTROLLERS["kuka"].to_numbers(read), numbers, atol=1e-9)


def test_abb_matches_reference_manual():
    """Data type `orient`, example 2: 30 deg about y are [0.965926, 0, 0.258819, 0]."""
    cos, sin = np.cos(np.pi / 6), np.sin(np.pi / 6)
    axes = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    written = CONTROLLERS["abb"].to_numbers(SE3(axes, np.array([0.1, 0, 0])))
    np.testing.assert_allclose(written, [100, 0, 0, 0.965926, 0, 0.258819, 0], atol=5e-7)
    np.testing.assert_allclose(CONTROLLERS["abb"].read(written).rotation, axes, atol=1e-12)


def test_fanuc_quaternion_matches_camera_makers_formula():
    """Roboception's formula for W, P, R is written out; lengths are in mm."""
    w, p, r = np.radians([10, -20, 30]) / 2
    x = np.cos(r) * np.cos(p) * np.sin(w) - np.sin(r) * np.sin(p) * np.cos(w)
    y = np.cos(r) * np.sin(p) * np.cos(w) + np.sin(r) * np.cos(p) * np.sin(w)
    read = CONTROLLERS["fanuc"].read(np.array([1000, 0, 0, 10, -20, 30]))
    np.testing.assert_allclose(read.quaternion[:2], [x, y], atol=1e-14)
    np.testing.assert_allclose(read.translation, [1, 0, 0])


def test_yaskawa_quaternion_matches_camera_makers_formula():
    """Basler's formula for Rx, Ry, Rz is written out; lengths are in mm."""
    x, y, z = np.radians([10, -20, 30]) / 2
    qz = np.sin(z) * np.cos(y) * np.cos(x) - np.cos(z) * np.sin(y) * np.sin(x)
    qw = np.cos(z) * np.cos(y) * np.cos(x) + np.sin(z) * np.sin(y) * np.sin(x)
    read = CONTROLLERS["yaskawa"].read(np.array([0, 1000, 0, 10, -20, 30]))
    np.testing.assert_allclose(read.quaternion[2:], [qz, qw], atol=1e-14)
    np.testing.assert_allclose(read.translation, [0, 1, 0])


@pytest.mark.parametrize("name", ["fanuc", "yaskawa"])
def test_fanuc_and_yaskawa_match_robodk(name):
    """Both directions [mm, deg] agree with the matrix of `Fanuc_2_Pose` and `Motoman_2_Pose` of RoboDK 6.0.2."""
    numbers = [100.0, -200.0, 300.0, 25.0, -40.0, 110.0]
    matrix = [
        [-0.26200263, -0.758739674, 0.596379685],
        [0.71984631, -0.565246574, -0.402886585],
        [0.64278761, 0.323744371, 0.694272044],
    ]
    read = CONTROLLERS[name].read(np.array(numbers))
    np.testing.assert_allclose(read.rotation, matrix, atol=1e-9)
    np.testing.assert_allclose(read.translation, [0.1, -0.2, 0.3], atol=1e-15)
    np.testing.assert_allclose(CONTROLLERS[name].to_numbers(read), numbers, atol=1e-9)


def test_staubli_angles_rotate_about_x_new_y_new_z():
    """Angles are about x, the new y and the new z, in degrees and mm."""
    read = CONTROLLERS["staubli"].read(np.array([100, 0, 0, 10, 20, 30]))
    np.testing.assert_allclose(
        read.rotation, Rotation.from_euler("XYZ", [10, 20, 30], degrees=True).as_matrix(), atol=1e-14
    )
    np.testing.assert_allclose(read.translation, [0.1, 0, 0])


def test_staubli_matches_robodk():
    """Both directions of X, Y, Z [mm] and Rx, Ry, Rz [deg] agree with `Staubli_2_Pose` of RoboDK 6.0.2."""
    numbers = [100.0, -200.0, 300.0, 25.0, -40.0, 110.0]
    matrix = [
        [-0.26200263, -0.71984631, -0.64278761],
        [0.944561805, -0.054704465, -0.323744371],
        [0.197882839, -0.691974502, 0.694272044],
    ]
    read = CONTROLLERS["staubli"].read(np.array(numbers))
    np.testing.assert_allclose(read.rotation, matrix, atol=1e-9)
    np.testing.assert_allclose(read.translation, [0.1, -0.2, 0.3], atol=1e-15)
    np.testing.assert_allclose(CONTROLLERS["staubli"].to_numbers(read), numbers, atol=1e-9)


def test_denso_angles_rotate_about_fixed_axes():
    """Angles are about fixed x, y and z, in degrees and mm."""
    read = CONTROLLERS["denso"].read(np.array([100, 0, 0, 10, 20, 30]))
    expected = Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix()
    np.testing.assert_allclose(read.rotation, expected, atol=1e-14)
    np.testing.assert_allclose(read.translation, [0.1, 0, 0])


def test_denso_rz_rotates_base_x_about_z():
    """The flange's x is the base's x rotated about z by RZ if RZ is the only angle, as stated in the manual."""
    x = CONTROLLERS["denso"].read(np.array([0, 0, 0, 0, 0, 30])).rotation[:, 0]
    np.testing.assert_allclose(x, [np.cos(np.pi / 6), 0.5, 0], atol=1e-15)


def test_franka_start_pose_of_examples():
    """At q = [0, -pi/4, 0, -3 pi/4, 0, pi/2, pi/4] the hand points down, by its maker's DH parameters."""
    reported = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0.3069, 0, 0.4869, 1]
    read = CONTROLLERS["franka"].read(np.array(reported, dtype=float))
    np.testing.assert_allclose(read.translation, [0.3069, 0, 0.4869])
    np.testing.assert_allclose(read.rotation @ [0, 0, 1], [0, 0, -1])


def test_franka_matches_documented_robot_state() -> None:
    """`O_T_EE` in the output of `echo_robot_state` is the hand's pose at the joints beside it.

    Source: docs of the Franka Control Interface, "Getting started", example output; Craig's DH parameters of "Robot and
    interface specifications", and `F_T_EE` of that output.
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
    np.testing.assert_allclose(CONTROLLERS["franka"].read(np.array(shown)).matrix, hand @ tip, atol=2e-5)


def test_franka_matrix_is_by_columns():
    """For a quarter turn about z the first three numbers are the rotated x axis."""
    read = CONTROLLERS["franka"].read(np.array([0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0.1, 0.2, 0.3, 1.0]))
    np.testing.assert_allclose(read.rotation @ [1, 0, 0], [0, 1, 0])


def test_franka_matrix_by_rows_is_refused():
    """A matrix written by rows has its translation where zeros must be."""
    with pytest.raises(InputError, match="last row"):
        CONTROLLERS["franka"].read(np.array([0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1.0]))


def test_doosan_angles_rotate_about_z_new_y_new_z():
    """Angles are about z, the new y and the new z, in degrees and mm."""
    read = CONTROLLERS["doosan"].read(np.array([100, 0, 0, 10, 20, 30]))
    np.testing.assert_allclose(
        read.rotation, Rotation.from_euler("ZYZ", [10, 20, 30], degrees=True).as_matrix(), atol=1e-14
    )
    np.testing.assert_allclose(read.translation, [0.1, 0, 0])


def test_xarm_angles_rotate_about_fixed_axes():
    """Roll, pitch and yaw are about fixed axes, in degrees and mm."""
    read = CONTROLLERS["xarm"].read(np.array([100, 0, 0, 180, 20, 30]))
    np.testing.assert_allclose(
        read.rotation, Rotation.from_euler("xyz", [180, 20, 30], degrees=True).as_matrix(), atol=1e-14
    )
    np.testing.assert_allclose(read.translation, [0.1, 0, 0])


def test_ros_quaternion_has_scalar_last():
    """A quarter turn about z is read as `tf2_echo` prints it, in metres."""
    read = CONTROLLERS["ros"].read(np.array([0.1, 0.2, 0.3, 0, 0, 0.7071, 0.7071]))
    np.testing.assert_allclose(read.rotation @ [1, 0, 0], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(read.translation, [0.1, 0.2, 0.3])


def test_matrix_is_by_rows():
    """For a quarter turn about z the translation is at the end of each row."""
    read = CONTROLLERS["matrix"].read(np.array([0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1.0]))
    np.testing.assert_allclose(read.rotation @ [1, 0, 0], [0, 1, 0])
    np.testing.assert_allclose(read.translation, [0.1, 0.2, 0.3])
