"""All residuals with their Jacobian, as general solvers want them: vectorised, and never computed twice."""

from __future__ import annotations

import numpy as np

from basecal.estimation.least_squares.jacobians import unknown_jacobian
from basecal.estimation.problem.problem import Problem, State, chain
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import Array
from basecal.geometry.se3_jacobians import right_jacobian
from benchmarks.solve.task import moved


class Whole:
    """Residuals (14400,) and Jacobian (14400, 18) to right tangents of the unknowns, kept for the last state asked."""

    def __init__(self, problem: Problem, start: State) -> None:
        (self.group,) = problem.groups
        assert isinstance(self.group.measurement, PixelMeasurement)
        self.problem, self.start, self.names = problem, start, tuple(problem.columns)
        self.forget()

    def forget(self) -> None:
        """Start anew."""
        self.calls = 0
        self._key: bytes = b""
        self._kept: tuple[Array, Array] = (np.zeros(0), np.zeros((0, 0)))

    def at_step(self, step: Array) -> tuple[Array, Array]:
        """At the start moved by (18,) tangents; the derivative is to these."""
        key = step.tobytes()
        if key != self._key:
            residual, jacobian = self.evaluate(moved(self.start, self.names, step))
            for k, xi in enumerate(step.reshape(-1, 6)):
                if np.any(xi):
                    block = jacobian[:, 6 * k : 6 * k + 6]
                    block[:] = block @ right_jacobian(xi)
            self._key, self._kept = key, (residual, jacobian)
        return self._kept

    def at_state(self, state: State, key: bytes) -> tuple[Array, Array]:
        """At a state, which `key` tells from others; the derivative is to its own tangents."""
        if key != self._key:
            self._key, self._kept = key, self.evaluate(state)
        return self._kept

    def evaluate(self, state: State) -> tuple[Array, Array]:
        """At a state."""
        self.calls += 1
        group, seen = self.group, self.group.measurement
        assert isinstance(seen, PixelMeasurement)
        links = chain(group, state, self.problem.stops)
        pose = links.camera_from_target
        points = seen.points_in_target @ np.swapaxes(pose.rotation, -1, -2) + pose.translation[:, None]
        pixels, by_point, _ = state.cameras[group.camera].project_with_derivatives(points)
        by_pose = _by_pose(by_point * seen.weight[..., None, None], pose.rotation, seen.points_in_target)
        by_step, columns = unknown_jacobian(self.problem, group, links, 6)
        jacobian = by_pose @ by_step[..., np.argsort(columns)]
        residual = (pixels - seen.pixels) * seen.weight[..., None]
        return residual.reshape(-1), jacobian.reshape(-1, jacobian.shape[-1])


def _by_pose(by_point: Array, rotation: Array, points: Array) -> Array:
    """Derivative of residuals to their views' poses, (n, 2 p, 6)."""
    n, p = by_point.shape[:2]
    rotated = by_point.reshape(n, 2 * p, 3) @ rotation
    x, y, z = np.repeat(points, 2, axis=0).T
    u, v, w = rotated[..., 0], rotated[..., 1], rotated[..., 2]
    out = np.empty((n, 2 * p, 6))
    out[..., :3] = rotated
    out[..., 3], out[..., 4], out[..., 5] = y * w - z * v, z * u - x * w, x * v - y * u
    return out


def covariance(jacobian: Array) -> Array:
    """Inverse of the information."""
    inverse: Array = np.linalg.inv(jacobian.T @ jacobian)
    return inverse
