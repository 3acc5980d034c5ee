"""Every controller's numbers give their pose back, and are those of SciPy."""

from __future__ import annotations

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
def test_numbers_give_their_pose_back(name):
    """To 1e-12 m and 1e-12 of the matrix, at half turns and gimbal lock too; as many numbers as there are names."""
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
def test_forms_are_those_of_scipy(form, of_scipy):
    """Read as SciPy reads them, which is another's code, and written so that SciPy reads the rotation."""
    numbers = form.written(DRAWN.as_matrix())
    np.testing.assert_allclose(of_scipy(numbers).as_matrix(), DRAWN.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(form.read(numbers), DRAWN.as_matrix(), atol=1e-14)


def test_one_frame_in_the_words_of_four_makers():
    """A frame by two of its axes, as another library says it for ABB, Stäubli, KUKA and UR.

    Source: compas.dev, COMPAS, tutorial "Frames": `Frame(point, xaxis, yaxis)`; of it ABB takes the quaternion, scalar
    first, Stäubli Euler angles xyz and KUKA zyx about moving axes, and UR the axis-angle vector.
    """
    x = np.array([0.9767, 0.0010, -0.214]) / np.linalg.norm([0.9767, 0.0010, -0.214])
    z = np.cross(x, [0.1002, 0.8818, 0.4609])
    z /= np.linalg.norm(z)
    frame = np.stack([x, np.cross(z, x), z], axis=-1)
    turn = Rotation.from_matrix(frame)
    point = [146.0, 150.0, 161.5]
    said = {
        "abb": [*point, *turn.as_quat(scalar_first=True)],
        "staubli": [*point, *turn.as_euler("XYZ", degrees=True)],
        "kuka": [*point, *turn.as_euler("ZYX", degrees=True)],
        "ur": [*np.array(point) / 1e3, *turn.as_rotvec()],
    }
    for name, numbers in said.items():
        read = CONTROLLERS[name].read(np.array(numbers))
        np.testing.assert_allclose(read.rotation, frame, atol=1e-12, err_msg=name)
        np.testing.assert_allclose(read.translation, [0.146, 0.15, 0.1615], atol=1e-15, err_msg=name)


def test_what_is_no_quaternion_is_said():
    """Rounded ones are taken, others are errors."""
    np.testing.assert_allclose(QUATERNION_WXYZ.read(np.array([0.7071, 0.7071, 0, 0]))[2, 1], 1.0, atol=1e-9)
    with pytest.raises(InputError, match="norm"):
        QUATERNION_WXYZ.read(np.array([1.0, 1.0, 0, 0]))
