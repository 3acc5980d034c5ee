"""Find a scene from its images: each camera alone, then the transforms between cameras, then a joint adjustment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from basecal.accuracy.scene.checks import SAME_SPOT, camera_findings, join_findings, kept_findings
from basecal.accuracy.scene.images import Images
from basecal.accuracy.scene.joining import Join, find_join, merged_tracks, shared_points
from basecal.accuracy.scene.one_camera import OneCamera, solve_camera
from basecal.accuracy.verdicts import judge_findings
from basecal.cell import Finding
from basecal.estimation.scene.adjust import SceneFit
from basecal.estimation.scene.fit import fit_scene
from basecal.estimation.scene.state import start_state
from basecal.estimation.scene.views import Tracks
from basecal.estimation.settings import Settings
from basecal.geometry import SE3, Array
from basecal.numerics.batch import concatenate, take
from basecal.vision.tracks.locating import locate_camera


@dataclass
class Report:
    """Findings of a calibration in progress."""

    findings: list[Finding] = field(default_factory=list)

    @property
    def is_refused(self) -> bool:
        """Whether a finding is an error."""
        return judge_findings(self.findings) == "refused"


def find_scene(
    images: Images, robot_noise: Sequence[Array | None], reference: str, report: Report, settings: Settings
) -> SceneFit | None:
    """Estimate the scene that all images show.

    Args:
        images: Images of all cameras.
        robot_noise: (6,) noise of each robot [m, rad]; None if it is to be estimated.
        reference: The robot whose base is the world.
        report: The report to which findings are added.
        settings: Settings of the calibration.

    Returns:
        The scene, or None if it is refused; findings of the report then state the reason.
    """
    every, images = images, images.select_moving()
    with settings.stage("tracks"):
        ones = [_solve_one(images, camera, robot_noise, settings) for camera in range(len(images.views.cameras))]
    for camera, one in zip(images.views.cameras, ones, strict=True):
        joint_robots = [robot for robot in images.joint_robots if robot == camera.robot]
        report.findings += camera_findings(camera.name, one, joint_robots)
    if report.is_refused:
        return None
    with settings.stage("joining"):
        joins = _joins(images, ones, report)
    if report.is_refused:
        return None
    with settings.stage("descent"):
        fit = _fit(images, ones, joins, robot_noise, reference, report)
        return fit if fit is None else _add_fixed_cameras(every, fit, robot_noise, report)


def _solve_one(images: Images, camera: int, robot_noise: Sequence[Array | None], settings: Settings) -> OneCamera:
    settings.report_progress(camera + 1, len(images.views.cameras))
    return solve_camera(images, camera, robot_noise[_carrier(images, camera)])


def _carrier(images: Images, camera: int) -> int:
    """Index of the robot that carries a camera."""
    return int(images.views.robot[images.views.camera == camera][0])


def _joins(images: Images, ones: Sequence[OneCamera], report: Report) -> dict[int, Join]:
    """Transforms from the first camera's scene to the scene of each other camera, by camera index."""
    joins = {}
    for index in range(1, len(ones)):
        found = find_join(images, ones[0], ones[index])
        names = (images.views.cameras[0].name, images.views.cameras[index].name)
        shared, of_each = 0, (0, 0)
        if found is not None:
            joins[index] = found
            shared, of_each = shared_points(images.views, merged_tracks(ones, {index: found}), index)
        report.findings += join_findings(names, found, shared, of_each)
    return joins


def _fit(
    images: Images,
    ones: Sequence[OneCamera],
    joins: Mapping[int, Join],
    robot_noise: Sequence[Array | None],
    reference: str,
    report: Report,
) -> SceneFit | None:
    """Adjust the images of all cameras jointly; None if that fails or is refused."""
    views = images.views
    bases = [SE3.identity() for _ in views.robots]
    for index, found in joins.items():
        bases[_carrier(images, index)] = found.second_from_first.inverse()
    reference_base = bases[views.robots.index(reference)]
    bases = [
        known.mean if known.status == "fixed" and known.mean is not None else reference_base.inverse() @ base
        for known, base in zip(views.bases, bases, strict=True)
    ]
    states, tracks = [one.adjustment.state for one in ones], merged_tracks(ones, joins)
    lenses = tuple(state.lenses[0] for state in states)
    start = start_state(views, [state.mounts[0] for state in states], bases, lenses)
    try:
        fit = fit_scene(views, tracks, start, lenses, robot_noise)
    except np.linalg.LinAlgError:
        what = "The images of all cameras fit no common scene."
        report.findings.append(Finding("scene-rival", "error", (), what, (SAME_SPOT,)))
        return None
    for index in joins:
        names = (views.cameras[0].name, views.cameras[index].name)
        before, after = (shared_points(views, each, index)[0] for each in (tracks, fit.tracks))
        report.findings += kept_findings(names, before, after)
    return None if report.is_refused else fit


def _add_fixed_cameras(images: Images, fit: SceneFit, robot_noise: Sequence[Array | None], report: Report) -> SceneFit:
    """Add the cameras on `world` to a scene, each located by the scene's points."""
    views, count = images.views, len(fit.views)
    if count == len(views):
        return fit
    descriptors = images.descriptors(fit.tracks)
    state, tracks, kept, cameras = fit.state, fit.tracks, list(range(count)), list(fit.views.cameras)
    for row in range(count, len(views)):
        index = int(views.camera[row])
        camera, lens = views.cameras[index], images.lenses[index]
        is_guessed = images.is_guessed[index]
        found = None if is_guessed else locate_camera(images.features[row], descriptors, state.points, lens)
        if found is None:
            report.findings.append(_missing_camera(camera.name, is_guessed))
            continue
        seen = images.features[row].pixels[found.feature]
        tracks = concatenate([tracks, Tracks(np.full(len(seen), len(kept)), found.point, seen, found.feature)])
        state = state.with_camera(found.camera_from_world.inverse(), lens)
        kept, cameras = [*kept, row], [*cameras, camera]
    own = replace(take(views, np.array(kept)), cameras=tuple(cameras))
    own = replace(own, camera=np.r_[own.camera[:count], np.arange(len(fit.views.cameras), len(cameras))])
    lenses = (*fit.guesses, *state.lenses[len(fit.guesses) :])
    return fit_scene(own, tracks, state, lenses, robot_noise) if len(kept) > count else fit


def _missing_camera(name: str, is_guessed: bool) -> Finding:
    """Finding of a camera on `world` that is left out, with the cause."""
    what = f"{name} is not used in the scene, and its pose remains unknown."
    why = "Its lens is not stated." if is_guessed else "Its image shows too few points that the arms' cameras see."
    do = "State its intrinsics in cell.yaml." if is_guessed else SAME_SPOT
    return Finding("scene-overlap", "warning", (name,), what, (do,), why)
