"""Contacts other than point on point: a tip on a plane or an edge, and directions of a part that two robots hold.

Residuals are coordinates of the camera frame in the axes of the target: its origin, and the directions of its axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from basecal.cell import Contact
from basecal.estimation.view.measurement import ViewInformation, make_information
from basecal.estimation.view.points import TouchMeasurement
from basecal.geometry import SE3, Array, Camera
from basecal.geometry.rotation import cross_matrix


class ContactMeasurement(TouchMeasurement):
    """A contact that constrains some coordinates of the camera frame in the target to zero.

    Attributes:
        rows: Slice of the constrained coordinates. The six coordinates are x, y, z of the camera's origin [m], x and y
            of its z axis, and y of its x axis.
        camera_gauge: (6,) directions of the camera's mount without effect: 1, else 0.
        target_gauge: (6,) directions of the target's mount without effect: 1, else 0.
    """

    rows: ClassVar[slice]
    camera_gauge: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0)
    target_gauge: ClassVar[tuple[int, ...]] = (0, 0, 0, 0, 0, 0)

    def residuals(self, camera_from_target: SE3, camera: Camera | None) -> Array:
        """See `SeenPoints`."""
        origin, z, x = _axes(camera_from_target)
        return np.concatenate([origin, z[..., :2], x[..., 1:2]], -1)[..., None, self.rows]

    def tangent_rows(
        self, camera_from_target: SE3, camera: Camera | None, with_lens: bool
    ) -> tuple[Array, Array, Array | None]:
        """See `SeenPoints`."""
        origin, z, x = map(cross_matrix, _axes(camera_from_target))
        rotations = np.concatenate([origin, z[..., :2, :], x[..., 1:2, :]], -2)
        translations = np.broadcast_to(-np.eye(6, 3), rotations.shape)
        jacobian = np.concatenate([translations, rotations], -1)[..., None, self.rows, :]
        return self.residuals(camera_from_target, camera), jacobian, None

    def linearise(self, camera_from_target: SE3, camera: Camera | None, with_lens: bool) -> ViewInformation:
        """See `Measurement`."""
        residuals, jacobian, _ = self.tangent_rows(camera_from_target, camera, with_lens)
        weight = self.weight[..., None]
        return make_information((residuals * weight)[..., 0, :], (jacobian * weight[..., None])[..., 0, :, :].mT)


def _axes(camera_from_target: SE3) -> tuple[Array, Array, Array]:
    """Origin, z axis and x axis of the camera in the axes of the target, (..., n, 3) each."""
    target_from_camera = camera_from_target.inverse()
    return target_from_camera.translation, target_from_camera.rotation[..., 2], target_from_camera.rotation[..., 0]


class PlaneMeasurement(ContactMeasurement):
    """A tip on the plane z = 0 of the target."""

    rows, coordinates = slice(2, 3), 1
    target_gauge = (1, 1, 0, 0, 0, 1)


class EdgeMeasurement(ContactMeasurement):
    """A tip on an edge along the z axis of the target."""

    rows, coordinates = slice(0, 2), 2
    target_gauge = (0, 0, 1, 0, 0, 1)


class HingeMeasurement(ContactMeasurement):
    """Parallel hinge axes: the z axes of both ends of a part that rotates about them."""

    rows, coordinates, noise_field = slice(3, 5), 2, "grip_rad"
    camera_gauge, target_gauge = (0, 0, 1, 0, 0, 1), (0, 0, 0, 0, 0, 1)


class GripMeasurement(ContactMeasurement):
    """The orientation of a part that two robots hold rigidly; the part has no frame of its own."""

    rows, coordinates, noise_field = slice(3, 6), 3, "grip_rad"
    camera_gauge = (0, 0, 0, 1, 1, 1)


TOUCHES: Mapping[Contact | None, type[TouchMeasurement]] = {
    None: TouchMeasurement,
    "plane": PlaneMeasurement,
    "edge": EdgeMeasurement,
    "clamp": TouchMeasurement,
    "hinge": TouchMeasurement,
}
"""Measurement of the position of a touch, by kind of contact."""

GRIPS: Mapping[Contact | None, type[ContactMeasurement]] = {"clamp": GripMeasurement, "hinge": HingeMeasurement}
"""Measurement of the directions of a touch, by kind of contact."""
