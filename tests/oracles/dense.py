"""A slow solver that shares nothing with the fast one but the equation: every stop error is an unknown of its own.

Derivatives are numeric, the system is dense, the loop is SciPy's.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import RigidTransform, Rotation

from basecal.cell import Cell, PixelObservation, PoseObservation, Recording


def matrix_of(xi):
    return RigidTransform.from_exp_coords(np.concatenate([xi[3:], xi[:3]])).as_matrix()


def tangent_of(matrix):
    turn_shift = RigidTransform.from_matrix(matrix).as_exp_coords()
    return np.concatenate([turn_shift[3:], turn_shift[:3]])


class DenseProblem:
    """Residuals of a cell with one camera and one target, all unknowns in one vector."""

    def __init__(self, cell: Cell, recording: Recording, about, stop_errors) -> None:
        """About these transforms and, of every stop in the order of robots and samples, errors in sigmas, (k, 6)."""
        self.cell, self.samples = cell, recording.samples
        self.about = {name: t.matrix for name, t in about.items()}
        self.stop_errors, self.as_recorded = np.ravel(stop_errors), {}
        self.camera, self.target = next(iter(cell.cameras.values())), next(iter(cell.targets.values()))
        self.point_mount = (
            cell.mount_name(self.target.name) if self.target.target and self.target.target.is_point else None
        )
        self.names = [n for n, u in cell.transforms.items() if u.status != "fixed"]
        self.width = sum(3 if n == self.point_mount else 6 for n in self.names)
        self.offsets = {}
        for name, robot in cell.robots.items():
            if "joint_offsets" in robot.parameters:
                self.offsets[name] = slice(self.width, self.width + robot.chain.n)
                self.width += robot.chain.n
        self.stops = {name: self._stops(name) for name, r in cell.robots.items() if r.noise is not None}
        self.total = self.width + 6 * sum(max(s) + 1 for s in self.stops.values())
        self.found_offsets = {}

    def _stops(self, robot):
        numbers, last, k = [], None, -1
        for i in range(len(self.samples)):
            m = self.recorded(robot, i, np.zeros(self.width))
            k += last is None or not np.array_equal(m, last)
            numbers.append(k)
            last = m
        return numbers

    def transforms(self, x):
        out, at = dict(self.about), 0
        for name in self.names:
            size = 3 if name == self.point_mount else 6
            out[name] = self.about[name] @ matrix_of(np.concatenate([x[at : at + size], np.zeros(6 - size)]))
            at += size
        return out

    def recorded(self, robot, index, x):
        """The flange by what was recorded, joints with their offsets; kept where nothing moves it."""
        if robot in self.offsets:
            return self._forward(robot, index, x)
        if (robot, index) not in self.as_recorded:
            self.as_recorded[robot, index] = self._forward(robot, index, x)
        return self.as_recorded[robot, index]

    def _forward(self, robot, index, x):
        state, chain = self.samples[index].robots[robot], self.cell.robots[robot].chain
        if state.joints_rad is None:
            return state.base_from_flange.matrix
        q = state.joints_rad + (x[self.offsets[robot]] if robot in self.offsets else 0.0)
        matrix = np.eye(4)
        for i, angle in enumerate(q):
            turn = np.eye(4)
            turn[:3, :3] = Rotation.from_rotvec(angle * chain.axes[i]).as_matrix()
            matrix = matrix @ chain.origins[i].matrix @ turn
        return matrix @ chain.tip.matrix

    def flange(self, robot, index, x):
        matrix = self.recorded(robot, index, x)
        if robot not in self.stops:
            return matrix
        at = self.width
        for name, stops in self.stops.items():
            if name == robot:
                break
            at += 6 * (max(stops) + 1)
        at += 6 * self.stops[robot][index]
        return matrix @ matrix_of(x[at : at + 6] * self.cell.robots[robot].noise)

    def _carried(self, on, mount, index, x, transforms):
        if on == "world":
            return transforms[mount]
        base = np.eye(4) if on == self.cell.reference else transforms[self.cell.base_name(on)]
        return base @ self.flange(on, index, x) @ transforms[mount]

    def residual(self, x):
        transforms = self.transforms(x)
        parts = [x[self.width :]]
        parts += [
            x[where] / self.cell.robots[name].parameters["joint_offsets"].sigma_rad
            for name, where in self.offsets.items()
        ]
        for i, sample in enumerate(self.samples):
            camera = self._carried(self.camera.on, self.cell.mount_name(self.camera.name), i, x, transforms)
            target = self._carried(self.target.on, self.cell.mount_name(self.target.name), i, x, transforms)
            parts += [self._view(o, np.linalg.inv(camera) @ target) for o in sample.observations]
        for name in self.names:
            unknown = self.cell.transforms[name]
            if unknown.status == "prior":
                size = 3 if name == self.point_mount else 6
                off = tangent_of(np.linalg.inv(unknown.mean.matrix) @ transforms[name])
                parts.append((off / unknown.sigma)[:size])
        return np.concatenate(parts)

    def _view(self, observation, camera_from_target):
        if isinstance(observation, PoseObservation):
            off = tangent_of(np.linalg.inv(observation.camera_from_target.matrix) @ camera_from_target)
            return off / observation.sigma
        assert isinstance(observation, PixelObservation)
        points = self.target.target.points[self.target.target.rows(observation.ids)]
        pixels = self.camera.intrinsics.camera.project(
            points @ camera_from_target[:3, :3].T + camera_from_target[:3, 3]
        )
        return ((pixels - observation.pixels) / self.cell.pixel_px).ravel()

    def solve(self):
        """Transforms, the covariance of their columns, and the cost; whoever starts at an optimum stays there."""
        start = np.concatenate([np.zeros(self.width), self.stop_errors])
        end = least_squares(self.residual, start, jac="3-point", method="trf", xtol=1e-10, ftol=1e-12, gtol=1e-10)
        j = end.jac
        covariance = np.linalg.inv(j.T @ j)[: self.width, : self.width]
        self.found_offsets = {name: end.x[where] for name, where in self.offsets.items()}
        return self.transforms(end.x), covariance, 2 * end.cost
