"""Where the work is done, and which transform brings a point there from one robot to another."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from basecal.cell import Cell
from basecal.errors import InputError
from basecal.geometry import SE3, Array
from basecal.geometry.rotation import cross_matrix


@dataclass(frozen=True, eq=False)
class Task:
    """Points at which a transform `reference_base_from_b` is used.

    Attributes:
        transform: Its name.
        points_m: (n, 3) the points in b [m].
    """

    transform: str
    points_m: Array

    def weight(self) -> Array:
        """(6, 6) W: the trace of W C is the mean variance at the points [m^2], C the covariance of the transform."""
        moved = np.concatenate(
            [np.broadcast_to(np.eye(3), (len(self.points_m), 3, 3)), -cross_matrix(self.points_m)], axis=-1
        )
        return np.asarray((np.swapaxes(moved, 1, 2) @ moved).mean(0))

    def variance_m2(self, covariance: Array) -> float:
        """The mean over the points of the mean squared error of their position [m^2]."""
        return float(np.trace(self.weight() @ covariance))


def base_transforms(cell: Cell) -> list[str]:
    """The requested transforms that place something in the reference's base, as work between robots needs it.

    Raises:
        InputError: if there is none.
    """
    names = [name for name in cell.asked if name.startswith(f"{cell.reference}_base_from_")]
    if not names:
        raise InputError(
            f"a task point is one in {cell.reference}_base, and nothing that is placed there is to be calibrated: "
            "leave the task point out, or set the base, camera or target it is about to `status: free`"
        )
    return names


def make_task(name: str, transforms: Mapping[str, SE3], points_m: Array) -> Task:
    """The task at points in the reference's base, (n, 3) [m], of a transform with this name."""
    return Task(name, transforms[name].inverse() @ points_m)


def least_known(tasks: Collection[Task], covariances: Mapping[str, Array]) -> Task:
    """Of the tasks of several transforms the one with the largest error."""
    return max(tasks, key=lambda task: task.variance_m2(covariances[task.transform]))
