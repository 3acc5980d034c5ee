"""Calibrate cameras and bases from the static scene that they see: one camera after another, then all together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from basecal.accuracy.scene.checks import (
    SAME_SPOT,
    aim_covariance,
    base_findings,
    camera_findings,
    direction_findings,
    join_findings,
    kept_findings,
)
from basecal.accuracy.scene.joining import Join, join
from basecal.accuracy.scene.merging import common_share, merged_tracks, shared_points
from basecal.accuracy.scene.one_camera import OneCamera, solve_camera
from basecal.accuracy.scene.pictures import Pictures, read_pictures
from basecal.accuracy.verdicts import judge_findings
from basecal.cell import Calibration, Cell, Finding, Recording, Residuals, SampleResidual
from basecal.errors import InputError
from basecal.estimation.scene.adjust import SceneFit, residuals_px
from basecal.estimation.scene.fit import fit_scene
from basecal.estimation.scene.spread import scene_covariance
from basecal.estimation.scene.state import Columns, SceneState, scene_columns
from basecal.estimation.settings import Settings
from basecal.geometry import SE3, Array, Camera, PoseEstimate

_UNIT = "The arms' own lengths give the scale: an error of unit in all poses cannot be seen."


@dataclass
class _Report:
    """Findings made so far."""

    findings: list[Finding] = field(default_factory=list)

    @property
    def is_refused(self) -> bool:
        """Whether one is an error."""
        return judge_findings(self.findings) == "refused"


def calibrate_scene(cell: Cell, recording: Recording, settings: Settings) -> Calibration:
    """Mounts, lenses and bases from pictures of a static scene.

    Args:
        cell: Cameras on robots; their mounts and the robots' bases are found.
        recording: Samples with pictures or tracks, and poses.
        settings: How to go about it.

    Raises:
        InputError: if the recording's folder is not known, or the reference carries no camera that took pictures.
    """
    with settings.stage("features"):
        pictures = read_pictures(cell, recording)
    if not len(pictures.views):
        raise InputError("no camera on a robot has pictures or tracks with poses: a scene is calibrated from these")
    if cell.reference not in pictures.views.robots:
        raise InputError(
            f"robot {cell.reference!r}, the reference, has no camera with pictures: name another reference"
        )
    report = _Report([*recording.findings, *pictures.lost])
    stated = [cell.robots[name].noise for name in pictures.views.robots]
    with settings.stage("tracks"):
        ones = [_solve_one(pictures, camera, stated, settings) for camera in range(len(pictures.views.cameras))]
    for camera, one in zip(pictures.views.cameras, ones, strict=True):
        report.findings += camera_findings(camera.name, one)
    if report.is_refused:
        return _refuse(report, settings)
    with settings.stage("joining"):
        joins = _joins(pictures, ones, report)
    if report.is_refused:
        return _refuse(report, settings)
    with settings.stage("descent"):
        fit = _fit(pictures, ones, joins, stated, cell.reference, report)
    return _refuse(report, settings) if fit is None else _conclude(cell, fit, report, settings)


def _solve_one(pictures: Pictures, camera: int, stated: Sequence[Array | None], settings: Settings) -> OneCamera:
    settings.part(camera + 1, len(pictures.views.cameras))
    rows = pictures.camera_views(camera)
    robot = int(pictures.views.robot[rows[0]]) if rows else 0
    return solve_camera(pictures, camera, stated[robot])


def _joins(pictures: Pictures, ones: Sequence[OneCamera], report: _Report) -> list[tuple[int, int, Join]]:
    """How the scene of each camera joins that of the first."""
    joins = []
    for index in range(1, len(ones)):
        found = join(pictures, ones[0], ones[index])
        names = (pictures.views.cameras[0].name, pictures.views.cameras[index].name)
        shared, of_each, common = 0, (0, 0), 0.0
        if found is not None:
            common = common_share(ones[0], ones[index], found)
            joins.append((0, index, found))
            tracks = merged_tracks(pictures, ones, [joins[-1]])
            shared, of_each = shared_points(pictures, tracks, (0, index))
        report.findings += join_findings(names, found, shared, of_each, common)
    return joins


def _fit(
    pictures: Pictures,
    ones: Sequence[OneCamera],
    joins: Sequence[tuple[int, int, Join]],
    stated: Sequence[Array | None],
    reference: str,
    report: _Report,
) -> SceneFit | None:
    """All pictures adjusted together."""
    fits = [one.fit for one in ones if one.fit is not None]
    lenses = tuple(fit.state.lenses[0] for fit in fits)
    views = pictures.views
    if not joins:
        start = replace(fits[0].state, errors=np.zeros((len(views.stop_robot), 6)))
    else:
        bases = [SE3.identity() for _ in views.robots]
        for _, index, found in joins:
            robot = int(views.robot[pictures.camera_views(index)[0]])
            bases[robot] = found.second_from_first.inverse()
        mounts = SE3.stack([fit.state.mounts[0] for fit in fits])
        home = bases[views.robots.index(reference)]
        bases = [
            known.mean if known.status == "fixed" and known.mean is not None else home.inverse() @ base
            for known, base in zip(views.bases, bases, strict=True)
        ]
        start = SceneState(mounts, SE3.stack(bases), lenses, np.zeros((len(views.stop_robot), 6)), np.zeros((0, 3)))
    tracks = merged_tracks(pictures, ones, joins)
    before = [shared_points(pictures, tracks, (i, k))[0] for i, k, _ in joins]
    try:
        fit = fit_scene(views, tracks, start, lenses, stated)
    except np.linalg.LinAlgError:
        what = "The pictures of all cameras fit no common scene."
        report.findings.append(Finding("scene-rival", "error", (), what, (SAME_SPOT,)))
        return None
    for (i, k, _), count in zip(joins, before, strict=True):
        names = (views.cameras[i].name, views.cameras[k].name)
        report.findings += kept_findings(names, count, shared_points(pictures, fit.tracks, (i, k))[0])
        report.findings += base_findings(names)
    return None if report.is_refused else fit


def _refuse(report: _Report, settings: Settings) -> Calibration:
    return Calibration("refused", findings=tuple(report.findings), settings=settings.as_dict())


class _Place(NamedTuple):
    """A transform of the answer, and its columns; None if it is fixed."""

    name: str
    mean: SE3
    columns: slice | None
    status: str


def _places(cell: Cell, fit: SceneFit, columns: Columns) -> list[_Place]:
    """The bases of robots, then the mounts of cameras."""
    mounts = [
        _Place(cell.mount_name(camera.name), fit.state.mounts[k], columns.mounts[k], camera.mount.status)
        for k, camera in enumerate(fit.views.cameras)
    ]
    bases = [
        _Place(cell.base_name(robot), fit.state.bases[k], columns.bases[k], fit.views.bases[k].status)
        for k, robot in enumerate(fit.views.robots)
        if robot != cell.reference
    ]
    return [*bases, *mounts]


def _covariance(fit: SceneFit, columns: Columns) -> Array:
    """Of all columns but errors of stops, with what views that aim at one point leave uncertain."""
    covariance = scene_covariance(fit)
    for k, where in enumerate(columns.mounts):
        if where is not None:
            covariance[where, where] += aim_covariance(fit, k)
    return covariance


def _conclude(cell: Cell, fit: SceneFit, report: _Report, settings: Settings) -> Calibration:
    """The calibration of a scene that was adjusted."""
    columns = scene_columns(fit.views, fit.state.lenses)
    covariance, places = _covariance(fit, columns), _places(cell, fit, columns)
    open_covariance = {each.name: covariance[each.columns, each.columns] for each in places if each.columns is not None}
    own = {each.name: open_covariance.get(each.name, np.zeros((6, 6))) for each in places}
    for name, spread in own.items():
        report.findings += direction_findings(name, spread)
    if report.is_refused:
        return _refuse(report, settings)
    report.findings.append(Finding("scene-scale", "info", (), _UNIT))
    rows = {each.name: each.columns for each in places if each.columns is not None}
    at = [row for where in rows.values() for row in range(where.start, where.stop)]
    verdict = judge_findings(report.findings)
    return Calibration(
        verdict,
        transforms={each.name: PoseEstimate(each.mean, own[each.name]) for each in places},
        status={each.name: each.status for each in places},
        cameras=_lenses(fit, columns, covariance),
        noise={"pixel_px": fit.sigma_px, "robots": _robot_noise(fit)},
        order=tuple(rows),
        joint_covariance=covariance[np.ix_(at, at)] if at else None,
        residuals=_residuals(fit),
        findings=tuple(report.findings),
        verdicts=dict.fromkeys(own, verdict),
        settings=settings.as_dict(),
    )


def _lenses(fit: SceneFit, columns: Columns, covariance: Array) -> dict[str, tuple[Camera, Array]]:
    """Lenses that are not fixed, with their covariance, by camera."""
    every = zip(fit.views.cameras, fit.state.lenses, columns.lenses, strict=True)
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
    """Sigmas of each robot's stops, by robot."""
    sigmas = {robot: fit.stop_sigma[fit.views.stop_robot == k][0] for k, robot in enumerate(fit.views.robots)}
    return {robot: {"sigma_t_m": own[:3].tolist(), "sigma_r_rad": own[3:].tolist()} for robot, own in sigmas.items()}
