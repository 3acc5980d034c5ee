"""How far apart flanges are that meet by a base from a scene: its error, and what the arms are off by there.

Errors that stops share move the base, too: both count together. Source: docs/mathematics.md (14.3).
"""

from __future__ import annotations

import numpy as np

from basecal.accuracy.scene.shared_errors import shared_errors
from basecal.accuracy.task.arms_at_points import move_nearest
from basecal.accuracy.task.expected_error import point_jacobian, pooled_quantile
from basecal.accuracy.task.meeting import choose_places
from basecal.accuracy.task.task import place_kind, placed_transforms, task_places
from basecal.cell import Cell, MeetingError
from basecal.estimation.scene.adjust import SceneFit
from basecal.estimation.settings import Settings
from basecal.geometry import Array


def scene_meeting(cell: Cell, fit: SceneFit, covariance: Array, settings: Settings) -> MeetingError | None:
    """The error where flanges meet, at the task or else where the arms worked, of the base that is known the least.

    Args:
        cell: What was calibrated.
        fit: A scene whose world is the base of the reference.
        covariance: (q, q) of all columns that are no errors of stops.
        settings: With the task.

    Returns:
        None if no base is requested.
    """
    task_m, placed = task_places(settings.task_point, settings.task_box), placed_transforms(cell)
    found = [
        _error_covariances(cell, fit, covariance, k, task_m)
        for k, robot in enumerate(fit.views.robots)
        if robot != cell.reference and cell.base_name(robot) in placed
    ]
    if not found:
        return None
    worst = max(found, key=_variance_m2)
    return MeetingError(
        pooled_quantile(worst, np.zeros((len(worst), 3))), place_kind(task_m), float(np.sqrt(_variance_m2(worst) / 3))
    )


def _variance_m2(covariances: Array) -> float:
    return float(np.mean(np.trace(covariances, axis1=1, axis2=2)))


def _error_covariances(cell: Cell, fit: SceneFit, covariance: Array, robot: int, task_m: Array) -> Array:
    """Covariances of the distance of two flanges, (n, 3, 3) [m^2], in the axes of the other robot's base."""
    columns = fit.columns.bases[robot]
    assert columns is not None
    reference, base = fit.views.robots.index(cell.reference), fit.state.bases[robot]
    points_m = task_m if len(task_m) else _recorded_places(fit, (reference, robot))
    places_m = {reference: (points_m, -base.rotation.T), robot: (base.inverse() @ points_m, np.eye(3))}
    by_base = point_jacobian(places_m[robot][0])
    total = by_base @ covariance[columns, columns] @ by_base.mT
    for index, (at_m, turn) in places_m.items():
        total += np.mean(fit.stop_sigma[fit.views.stop_robot == index, :3] ** 2) * np.eye(3)
        if not cell.robots[fit.views.robots[index]].is_total_noise:
            total += _shared_part(fit, index, at_m, turn, by_base, columns)
    return np.asarray(total)


def _recorded_places(fit: SceneFit, robots: tuple[int, int]) -> Array:
    """Where flanges of these robots were in the world, (n, 3) [m]."""
    mine = np.isin(fit.views.robot, robots)
    return choose_places(fit.state.world_from_flange(fit.views).translation[mine])


def _shared_part(fit: SceneFit, robot: int, at_m: Array, turn: Array, by_base: Array, columns: slice) -> Array:
    """The covariance that errors of a robot add, beside what they move the base by, (n, 3, 3) [m^2].

    Args:
        fit: The scene.
        robot: Index of the robot.
        at_m: (n, 3) where its flange is, in its base [m].
        turn: (3, 3) of these axes to those in which the distance is.
        by_base: (n, 3, 6) how the distance moves with the base.
        columns: Columns of the base.
    """
    poses = move_nearest(fit.views.base_from_flange[np.flatnonzero(fit.views.robot == robot)], at_m)
    total = np.zeros((len(at_m), 3, 3))
    for each in shared_errors(fit, robot):
        own = turn @ poses.rotation @ each.at(poses)[:, :3]
        mixed = by_base @ each.moves[columns] @ each.moment @ own.mT
        total += mixed + mixed.mT + own @ each.moment @ own.mT + each.unseen_m2(poses)[:, None, None] * np.eye(3)
    return total
