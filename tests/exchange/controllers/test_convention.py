"""Tests that every controller's numbers restore their pose and agree with SciPy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.errors import InputError
from basecal.exchange.controllers.convention import (
    FIXED_XYZ,
    MOVING_XYZ,
    MOVING_ZYX,
    MOVING_ZYZ,
    QUATERNION_WXYZ,
    QUATERNION_XYZW,
    ROTATION_VECTOR,
)
from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.geometry import SE3

DRAWN = Rotation.from_quat(np.random.default_rng(0).normal(size=(100, 4)))
HARD = Rotation.from_euler("ZYX", [[0.3, np.pi / 2, 0.2], [0.3, -np.pi / 2 + 1e-9, 0.2], [0, 0, 0], [np.pi, 0, 0]])
POSES = SE3(
    np.concatenate([DRAWN.as_matrix(), HARD.as_matrix()]), np.random.default_rng(1).uniform(-2, 2, (len(DRAWN) + 4, 3))
)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_controller_numbers_restore_pose(name):
    """Poses are restored to 1e-12 m and 1e-12 of the matrix, also at half turns and gimbal lock.

    There are as many numbers as names.
    """
    kind = CONTROLLERS[name]
    numbers = kind.to_numbers(POSES)
    assert numbers.shape[-1] == len(kind.names)
    again = kind.read(numbers)
    np.testing.assert_allclose(again.matrix, POSES.matrix, atol=1e-12)
    np.testing.assert_allclose(kind.read(numbers[0]).matrix, POSES[0].matrix, atol=1e-12)


@pytest.mark.parametrize(
    ("form", "of_scipy"),
    [
        (ROTATION_VECTOR, Rotation.from_rotvec),
        (FIXED_XYZ, lambda angles: Rotation.from_euler("xyz", angles)),
        (MOVING_ZYX, lambda angles: Rotation.from_euler("ZYX", angles)),
        (MOVING_XYZ, lambda angles: Rotation.from_euler("XYZ", angles)),
        (MOVING_ZYZ, lambda angles: Rotation.from_euler("ZYZ", angles)),
        (QUATERNION_XYZW, Rotation.from_quat),
        (QUATERNION_WXYZ, lambda wxyz: Rotation.from_quat(wxyz, scalar_first=True)),
    ],
)
def test_rotation_forms_agree_with_scipy(form, of_scipy):
    """Rotations are read like SciPy's independent code, and written so that SciPy reads them."""
    numbers = form.to_numbers(DRAWN.as_matrix())
    np.testing.assert_allclose(of_scipy(numbers).as_matrix(), DRAWN.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(form.read(numbers), DRAWN.as_matrix(), atol=1e-14)


def test_one_frame_in_notation_of_four_makers():
    """A frame by two of its axes is the same in the notation of ABB, Stäubli, KUKA and UR.

    Source: compas.dev, COMPAS, tutorial "Frames": `Frame(point, xaxis, yaxis)`. There ABB takes the quaternion, scalar
    first, Stäubli Euler angles xyz and KUKA zyx about moving axes, and UR the axis-angle vector.
    """
    x = np.array([0.9767, 0.0010, -0.214]) / np.linalg.norm([0.9767, 0.0010, -0.214])
    z = np.cross(x, [0.1002, 0.8818, 0.4609])
    z /= np.linalg.norm(z)
    frame = np.stack([x, np.cross(z, x), z], axis=-1)
    turn = Rotation.from_matrix(frame)
    point = [146.0, 150.0, 161.5]
    notations = {
        "abb": [*point, *turn.as_quat(scalar_first=True)],
        "staubli": [*point, *turn.as_euler("XYZ", degrees=True)],
        "kuka": [*point, *turn.as_euler("ZYX", degrees=True)],
        "ur": [*np.array(point) / 1e3, *turn.as_rotvec()],
    }
    for name, numbers in notations.items():
        read = CONTROLLERS[name].read(np.array(numbers))
        np.testing.assert_allclose(read.rotation, frame, atol=1e-12, err_msg=name)
        np.testing.assert_allclose(read.translation, [0.146, 0.15, 0.1615], atol=1e-15, err_msg=name)


def test_invalid_quaternion_is_refused():
    """Rounded quaternions are accepted, others are errors."""
    np.testing.assert_allclose(QUATERNION_WXYZ.read(np.array([0.7071, 0.7071, 0, 0]))[2, 1], 1.0, atol=1e-9)
    with pytest.raises(InputError, match="norm"):
        QUATERNION_WXYZ.read(np.array([1.0, 1.0, 0, 0]))


@pytest.mark.parametrize("name", CONTROLLERS)
def test_single_pose_and_grid_of_poses_are_written(name):
    """Leading axes of the poses are kept."""
    kind = CONTROLLERS[name]
    rows = kind.to_numbers(POSES)
    np.testing.assert_allclose(kind.to_numbers(POSES[3]), rows[3], atol=1e-12)
    grid = SE3(POSES.rotation[:6].reshape(2, 3, 3, 3), POSES.translation[:6].reshape(2, 3, 3))
    np.testing.assert_allclose(kind.to_numbers(grid).reshape(6, -1), rows[:6], atol=1e-12)
    np.testing.assert_allclose(kind.read(kind.to_numbers(grid)).matrix, grid.matrix, atol=1e-12)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_lengths_use_stated_unit(name):
    """Three numbers of each pose have the unit in both directions; the rotation does not depend on it."""
    kind = replace(CONTROLLERS[name], length=0.5)
    numbers, metres = kind.to_numbers(POSES), replace(kind, length=1.0).to_numbers(POSES)
    ratio = numbers[0] / np.where(metres[0] == 0, 1, metres[0])
    assert np.count_nonzero(np.isclose(ratio, 2.0)) == 3
    np.testing.assert_allclose(kind.read(metres).translation, 0.5 * POSES.translation, atol=1e-12)
    np.testing.assert_allclose(kind.read(metres).rotation, POSES.rotation, atol=1e-12)


def test_controllers_without_angles():
    """ABB, ROS, Franka and matrices have no angles; all other formats have them."""
    assert {name for name, kind in CONTROLLERS.items() if not kind.has_angles} == {"abb", "ros", "franka", "matrix"}


def test_row_and_column_matrices_are_distinguished():
    """The place of 0 0 0 1 decides, and the error names the other format; a pose at the origin fits both."""
    rows, columns = CONTROLLERS["matrix"], CONTROLLERS["franka"]
    with pytest.raises(InputError, match="by rows, give --format matrix"):
        columns.read(rows.to_numbers(POSES))
    with pytest.raises(InputError, match="it is transposed, give --format franka"):
        rows.read(columns.to_numbers(POSES[:1]))
    origin = SE3(POSES.rotation, np.zeros_like(POSES.translation))
    for kind in (rows, columns):
        np.testing.assert_allclose(kind.read(kind.to_numbers(origin)).rotation, origin.rotation, atol=1e-12)
    with pytest.raises(InputError, match="last row"):
        rows.read(np.full(16, 0.3))
