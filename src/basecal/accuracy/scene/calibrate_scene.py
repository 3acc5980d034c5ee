"""Calibrate cameras and bases from the static scene that they see, without a target."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from basecal.accuracy.scene.checks import (
    base_findings,
    describe_scatter,
    direction_findings,
    drop_target_findings,
    joint_findings,
    missing_base_findings,
    motion_findings,
    points_finding,
)
from basecal.accuracy.scene.find_scene import Report, find_scene
from basecal.accuracy.scene.fingerprint import scene_fingerprint
from basecal.accuracy.scene.images import read_images
from basecal.accuracy.scene.shared_errors import scene_motion, shared_covariance, shared_errors
from basecal.accuracy.task.expected_error import point_jacobian, pool_errors
from basecal.accuracy.task.kinematic_errors import move_nearest
from basecal.accuracy.task.meeting import choose_places
from basecal.accuracy.task.task import placed_transforms, task_places
from basecal.accuracy.verdicts import judge_findings
from basecal.cell import Calibration, Cell, Finding, MeetingError, Recording, Residuals, SampleResidual, Unknown
from basecal.errors import InputError
from basecal.estimation.scene.adjust import SceneFit, residuals_px
from basecal.estimation.scene.spread import scene_covariance
from basecal.estimation.settings import Settings
from basecal.geometry import SE3, Array, Camera, PoseEstimate

_UNKNOWN_SIGMA = 1e3  # [m, rad] sigma of an unknown direction, far larger than any cell; assumed
_SCALE_NOTE = "The scale is that of the robot poses: a wrong unit in all poses cannot be detected."


def calibrate_scene(cell: Cell, recording: Recording, settings: Settings) -> Calibration:
    """Calibrate mounts, lenses and bases from images of a static scene.

    Args:
        cell: Cameras on robots; their mounts and the robots' bases are estimated.
        recording: Samples with images or tracks, and poses.
        settings: Settings of the calibration; `method` is ignored.

    Raises:
        InputError: if the recording's folder is not known, no camera on a robot has images with poses, or the
            reference robot has none.
    """
    settings = replace(settings, method="scene")  # also if the cell requests it, or has tracks alone
    with settings.stage("features"):
        images = read_images(cell, recording, settings)
    if not len(images.views):
        lost = " ".join(finding.what for finding in images.lost[:1])
        raise InputError(lost or "no camera on a robot has images or tracks with poses, which a scene needs")
    if cell.reference not in images.views.robots:
        what = f"robot {cell.reference!r}, the reference, has no camera with images"
        raise InputError(f"{what}: state another as `reference:` in cell.yaml")
    report = Report([*drop_target_findings(recording.findings), *images.lost])
    stated = [cell.robots[name].noise for name in images.views.robots]
    fit = find_scene(images, stated, cell.reference, report, settings)
    if fit is None:
        return _refuse(report, settings)
    found = _conclude(cell, fit, report, settings)
    return replace(found, scene=scene_fingerprint(images, fit, fit.state.points)) if found.transforms else found


def _refuse(report: Report, settings: Settings) -> Calibration:
    return Calibration("refused", findings=tuple(report.findings), settings=settings.as_dict())


class _Transform(NamedTuple):
    """An estimated transform, its prior, and its columns of the covariance; the columns are None if it is fixed."""

    name: str
    mean: SE3
    statement: Unknown
    columns: slice | None

    def estimate(self, covariance: Array) -> PoseEstimate:
        """Return the transform with its block of a covariance, (6, 6) [m, rad]; zero if the transform is fixed."""
        return PoseEstimate(self.mean, covariance[self.columns, self.columns] if self.columns else np.zeros((6, 6)))


def _transforms(cell: Cell, fit: SceneFit) -> tuple[list[_Transform], list[_Transform]]:
    """Bases of all robots except the reference, and mounts of all cameras."""
    views, state, columns = fit.views, fit.state, fit.columns
    names = [cell.base_name(robot) for robot in views.robots], [cell.mount_name(each.name) for each in views.cameras]
    bases = map(_Transform, names[0], state.bases, views.bases, columns.bases)
    mounts = map(_Transform, names[1], state.mounts, (each.mount for each in views.cameras), columns.mounts)
    return [each for each in bases if each.name != cell.base_name(cell.reference)], list(mounts)


def _covariance(cell: Cell, fit: SceneFit) -> Array:
    """Covariance of all columns except stop errors, (q, q), including the errors that stops of a robot share."""
    covariance = scene_covariance(fit)
    for k, robot in enumerate(fit.views.robots):
        if not cell.robots[robot].is_total_noise:
            covariance += shared_covariance(fit, k)
    return covariance


def _conclude(cell: Cell, fit: SceneFit, report: Report, settings: Settings) -> Calibration:
    """Return the calibration from an adjusted scene; refused if a finding is an error."""
    covariance, (bases, mounts) = _covariance(cell, fit), _transforms(cell, fit)
    motion = scene_motion(fit)
    for finding in motion_findings(motion):
        covariance, report.findings = covariance + np.outer(motion.step, motion.step), [*report.findings, finding]
    columns = {each.name: np.arange(each.columns.stop)[each.columns] for each in (*bases, *mounts) if each.columns}
    found = {each.name: each.estimate(covariance) for each in (*bases, *mounts)}
    for name, estimate in found.items():
        report.findings += direction_findings(name, estimate.covariance, describe_scatter(fit))
    for each in bases:
        if each.columns and not report.is_refused:
            report.findings += base_findings(each.name, *_compare_statement(each.statement, found[each.name]))
    if report.is_refused:
        return _refuse(report, settings)
    report.findings += [points_finding(fit), Finding("scene-scale", "info", (), _SCALE_NOTE)]
    report.findings += joint_findings(cell, fit.views.robots)
    indices = np.concatenate([[], *columns.values()]).astype(np.int64)
    verdict = judge_findings(report.findings)
    report.findings += missing_base_findings(cell, fit.views.robots)
    return Calibration(
        judge_findings(report.findings),
        transforms=found,
        status={each.name: each.statement.status for each in (*bases, *mounts)},
        cameras=_lenses(fit, covariance),
        noise={"pixel_px": fit.sigma_px, "robots": _robot_noise(fit)},
        order=tuple(columns),
        joint_covariance=covariance[np.ix_(indices, indices)] if len(indices) else None,
        residuals=_residuals(fit),
        findings=tuple(report.findings),
        verdicts=dict.fromkeys(found, verdict),
        settings=settings.as_dict(),
        meeting=scene_meeting(cell, fit, covariance, settings),
    )


def _compare_statement(statement: Unknown, base: PoseEstimate) -> tuple[Array | None, Array]:
    """Offset of a base by the scene alone from its prior, (3,) [m], and the offset's covariance, (3, 3) [m^2].

    The offset is None if the base has no prior.
    """
    if statement.mean is None or statement.sigma is None:
        return None, np.eye(3)
    sigma = np.minimum(statement.sigma, _UNKNOWN_SIGMA)
    information = np.linalg.inv(base.covariance)
    of_scene = np.linalg.inv(information - np.diag(1 / sigma**2))
    apart = of_scene @ information @ (statement.mean.inverse() @ base.mean).log()
    return apart[:3], (of_scene + np.diag(sigma**2))[:3, :3]


def _lenses(fit: SceneFit, covariance: Array) -> dict[str, tuple[Camera, Array]]:
    """Estimated lenses with their covariance, by camera name; fixed lenses are left out."""
    every = zip(fit.views.cameras, fit.state.lenses, fit.columns.lenses, strict=True)
    return {camera.name: (lens, covariance[where, where]) for camera, lens, where in every if where is not None}


def _residuals(fit: SceneFit) -> Residuals:
    residual = residuals_px(fit.views, fit.tracks, fit.state)
    median = float(np.median(np.linalg.norm(residual, axis=1)))
    square, views = (residual**2).mean(1), fit.views
    count = np.bincount(fit.tracks.view, minlength=len(views))
    rms_px = np.sqrt(np.bincount(fit.tracks.view, square, len(views)) / np.maximum(count, 1))
    own = tuple(
        SampleResidual(int(views.sample[k]), views.cameras[views.camera[k]].name, "scene", float(rms_px[k]))
        for k in np.flatnonzero(count)
    )
    return Residuals(rms_px=float(np.sqrt(np.mean(residual**2))), median_px=median, per_sample=own)


def _robot_noise(fit: SceneFit) -> dict[str, dict[str, list[float]]]:
    """Sigmas of stop errors, (3,) [m] and (3,) [rad], by robot name."""
    sigmas = {robot: fit.stop_sigma[fit.views.stop_robot == k][0] for k, robot in enumerate(fit.views.robots)}
    return {robot: {"sigma_t_m": own[:3].tolist(), "sigma_r_rad": own[3:].tolist()} for robot, own in sigmas.items()}


def scene_meeting(cell: Cell, fit: SceneFit, covariance: Array, settings: Settings) -> MeetingError | None:
    """Expected distance error between two flanges at a common point, of the base with the largest variance.

    The points are those of the task; without a task, the recorded flange positions. Errors that stops share also
    change the base estimate; their correlation is included. Source: docs/mathematics.md (14.3).

    Args:
        cell: The calibrated cell.
        fit: A scene whose world is the base of the reference.
        covariance: (q, q) of all columns except stop errors.
        settings: Settings with the task.

    Returns:
        The error, or None if no base is requested.
    """
    task_m, placed = task_places(settings.task_point, settings.task_box), placed_transforms(cell)
    covariances = (
        _error_covariances(cell, fit, covariance, k, task_m)
        for k, robot in enumerate(fit.views.robots)
        if robot != cell.reference and cell.base_name(robot) in placed
    )
    found = (pool_errors(each, np.zeros((len(each), 3)), task_m) for each in covariances)
    return max(found, key=lambda each: each.variance_m2, default=None)


def _error_covariances(cell: Cell, fit: SceneFit, covariance: Array, robot: int, task_m: Array) -> Array:
    """Covariances of the vector between two flanges, (n, 3, 3) [m^2], in the axes of the second robot's base."""
    columns = fit.columns.bases[robot]
    assert columns is not None
    reference, base = fit.views.robots.index(cell.reference), fit.state.bases[robot]
    points_m = task_m if len(task_m) else _recorded_places(fit, (reference, robot))
    places_m = {reference: (points_m, -base.rotation.T), robot: (base.inverse() @ points_m, np.eye(3))}
    by_base = point_jacobian(places_m[robot][0])
    total = by_base @ covariance[columns, columns] @ by_base.mT
    for index, (at_m, signed_rotation) in places_m.items():
        total += np.mean(fit.stop_sigma[fit.views.stop_robot == index, :3] ** 2) * np.eye(3)
        if not cell.robots[fit.views.robots[index]].is_total_noise:
            total += _shared_part(fit, index, at_m, signed_rotation, by_base, columns)
    return total


def _recorded_places(fit: SceneFit, robots: tuple[int, int]) -> Array:
    """Recorded flange positions of two robots in the world, (n, 3) [m]."""
    mine = np.isin(fit.views.robot, robots)
    return choose_places(fit.state.world_from_flange(fit.views).translation[mine])


def _shared_part(
    fit: SceneFit, robot: int, at_m: Array, signed_rotation: Array, by_base: Array, columns: slice
) -> Array:
    """Covariance from a robot's shared errors, with their correlation with the base, (n, 3, 3) [m^2].

    Args:
        fit: The scene.
        robot: Index of the robot.
        at_m: (n, 3) flange positions in the robot's base [m].
        signed_rotation: (3, 3) matrix from the axes of that base to the axes of the distance, with its sign.
        by_base: (n, 3, 6) derivative of the distance with respect to the base.
        columns: Columns of the base.
    """
    poses = move_nearest(fit.views.base_from_flange[np.flatnonzero(fit.views.robot == robot)], at_m)
    total = np.zeros((len(at_m), 3, 3))
    for each in shared_errors(fit, robot):
        own = signed_rotation @ poses.rotation @ each.flange_jacobian(poses)[:, :3]
        mixed = by_base @ each.moves[columns] @ each.moment @ own.mT
        total += mixed + mixed.mT + own @ each.moment @ own.mT + each.unseen_m2(poses)[:, None, None] * np.eye(3)
    return total
