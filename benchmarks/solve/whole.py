"""All residuals and their Jacobian for general solvers: vectorised, and never computed twice."""

from __future__ import annotations

import numpy as np

from basecal.estimation.least_squares.jacobians import unknown_jacobian
from basecal.estimation.problem.problem import Problem, State, chain
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import Array
from basecal.geometry.se3_jacobians import right_jacobian
from benchmarks.solve.task import move_start


class Whole:
    """Residuals (14400,) and Jacobian (14400, 18) by right tangents of the unknowns, cached for the last state."""

    def __init__(self, problem: Problem, start: State) -> None:
        (self.group,) = problem.groups
        assert isinstance(self.group.measurement, PixelMeasurement)
        self.problem, self.start, self.names = problem, start, tuple(problem.columns)
        self.forget()

    def forget(self) -> None:
        """Forget evaluations of earlier runs."""
        self.calls = 0
        self._key: bytes = b""
        self._evaluation: tuple[Array, Array] = (np.zeros(0), np.zeros((0, 0)))

    def at_step(self, step: Array) -> tuple[Array, Array]:
        """Residuals and Jacobian at the start moved by (18,) tangents, with derivatives by these tangents."""
        key = step.tobytes()
        if key != self._key:
            residual, jacobian = self.evaluate(move_start(self.start, self.names, step))
            for k, xi in enumerate(step.reshape(-1, 6)):
                if np.any(xi):
                    block = jacobian[:, 6 * k : 6 * k + 6]
                    block[:] = block @ right_jacobian(xi)
            self._key, self._evaluation = key, (residual, jacobian)
        return self._evaluation

    def evaluate(self, state: State) -> tuple[Array, Array]:
        """Residuals and Jacobian at a state."""
        self.calls += 1
        group, measurement = self.group, self.group.measurement
        assert isinstance(measurement, PixelMeasurement)
        links = chain(group, state, self.problem.stops)
        pose = links.camera_from_target
        points = measurement.points_in_target @ np.swapaxes(pose.rotation, -1, -2) + pose.translation[:, None]
        pixels, point_jacobian, _ = state.cameras[group.camera].project_with_derivatives(points)
        pose_jacobian = _pose_jacobian(
            point_jacobian * measurement.weight[..., None, None], pose.rotation, measurement.points_in_target
        )
        step_jacobian, columns = unknown_jacobian(self.problem, group, links, state, 6)
        jacobian = pose_jacobian @ step_jacobian[..., np.argsort(columns)]
        residual = (pixels - measurement.pixels) * measurement.weight[..., None]
        return residual.reshape(-1), jacobian.reshape(-1, jacobian.shape[-1])


def _pose_jacobian(by_point: Array, rotation: Array, points: Array) -> Array:
    """Derivative of residuals by the poses of their views, (n, 2 p, 6)."""
    n, p = by_point.shape[:2]
    rotated = by_point.reshape(n, 2 * p, 3) @ rotation
    x, y, z = np.repeat(points, 2, axis=0).T
    u, v, w = rotated[..., 0], rotated[..., 1], rotated[..., 2]
    out = np.empty((n, 2 * p, 6))
    out[..., :3] = rotated
    out[..., 3], out[..., 4], out[..., 5] = y * w - z * v, z * u - x * w, x * v - y * u
    return out


def covariance(jacobian: Array) -> Array:
    """Inverse of the information of a Jacobian."""
    inverse: Array = np.linalg.inv(jacobian.T @ jacobian)
    return inverse
