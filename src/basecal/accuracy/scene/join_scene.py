"""Join tracks of the static scene and the other observations in one solution.

The scene is estimated with the lenses and mounts from the other observations. It is used if it agrees with their
estimates of the bases, and predicts held-out views better.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from basecal.accuracy.cross_validation.folds import splits
from basecal.accuracy.cross_validation.station_scores import score_stations
from basecal.accuracy.model_comparison.held_out import compare_predicted_gains
from basecal.accuracy.scene.checks import base_findings, points_finding
from basecal.accuracy.scene.find_scene import Report, find_scene
from basecal.accuracy.scene.fingerprint import scene_fingerprint
from basecal.accuracy.scene.images import Images, read_images
from basecal.cell import Cell, Finding, Recording, Unknown
from basecal.cell.fingerprint import Fingerprint
from basecal.estimation.problem.build import scene_groups
from basecal.estimation.problem.problem import State
from basecal.estimation.scene.adjust import SceneFit
from basecal.estimation.scene.spread import scene_covariance, widening_factor
from basecal.estimation.scene.tie import with_scene
from basecal.estimation.scene.views import AT_WORLD
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_at_mode
from basecal.geometry import SE3, Array

_LINEARISATIONS = 2  # of the tracks: the second is about an optimum; assumed


def join_scene(
    cell: Cell, recording: Recording, solution: Solution, settings: Settings, outlier_samples: Collection[int]
) -> tuple[Solution, tuple[Finding, ...], Fingerprint | None]:
    """Solve again with the scene, if the scene improves the solution.

    Args:
        cell: Cell of the recording.
        recording: Samples with images or tracks.
        solution: Solution from the other observations.
        settings: Settings of the calibration.
        outlier_samples: Numbers of samples whose images are ignored, as their poses may be wrong.

    Returns:
        The solution with the scene, findings, and the scene's points. If the scene is not used: the solution
        unchanged, findings with the reason, and None.
    """
    report = Report()
    sound = tuple(each for each in recording.samples if each.sample not in outlier_samples)
    with settings.stage("features"):
        images = read_images(cell, replace(recording, samples=sound), settings)
    anchor = next((name for name in (cell.reference, *images.views.robots) if name in images.views.robots), None)
    if anchor is None:
        do = ("Record images of the scene with the robots' poses, or calibrate without --scene.",)
        what = "No camera has images or tracks with poses."
        return solution, (_explain_omission([Finding("scene-left-out", "error", (), what, do)]),), None
    stated = [_noise(solution, robot) for robot in images.views.robots]
    fit = find_scene(_update_images(images, solution, cell, anchor), stated, anchor, report, settings)
    if fit is None:
        return solution, (_explain_omission(report.findings),), None
    fit = _place_in_world(fit, solution.state.transforms.get(cell.base_name(anchor)))
    findings = tuple(_base_findings(cell, solution, fit))
    refused = [replace(each, severity="warning") for each in findings if each.severity == "error"]
    if refused:
        return solution, tuple(refused), None
    few = [each for each in report.findings if each.code == "few-images"]
    if few and not findings:
        return solution, (_explain_omission(few),), None
    with settings.stage("descent"):
        joined = _solve_jointly(cell, recording, solution, fit, settings)
    if not findings and not _predicts_better(joined, settings.iterations):
        return solution, (_explain_omission(()),), None
    assert joined.problem.tied is not None
    kept = scene_fingerprint(images, fit, joined.problem.tied.points)
    return joined, (*report.findings, *findings, points_finding(fit)), kept


def _update_images(images: Images, solution: Solution, cell: Cell, anchor: str) -> Images:
    """Replace lenses and mounts of images by those of a solution, with the base of robot `anchor` as the world."""
    views, state, open_names = images.views, solution.state, solution.observability.unobservable
    lenses = [state.cameras.get(c.name, lens) for c, lens in zip(views.cameras, images.lenses, strict=True)]
    mounts = [cell.mount_name(camera.name) for camera in views.cameras]
    return replace(
        images,
        views=replace(views, bases=tuple(AT_WORLD if name == anchor else Unknown() for name in views.robots)),
        lenses=tuple(lenses),
        is_guessed=tuple(
            is_guessed and c.name not in state.cameras
            for c, is_guessed in zip(views.cameras, images.is_guessed, strict=True)
        ),
        mounts=tuple(None if name in open_names else state.transforms.get(name) for name in mounts),
    )


def _noise(solution: Solution, robot: str) -> Array | None:
    """Noise of a robot's stops in a solution, (6,) [m, rad]; None if the robot has no stops there."""
    stops = solution.problem.stops
    return stops.sigma[stops.first[robot]] if robot in stops.first else None


def _place_in_world(fit: SceneFit, world_from_base: SE3 | None) -> SceneFit:
    """Transform a scene from the base of a robot to the world of the cell."""
    if world_from_base is None:
        return fit
    cameras = enumerate(fit.views.cameras)
    mounts = SE3.stack(
        [world_from_base @ fit.state.mounts[k] if each.robot is None else fit.state.mounts[k] for k, each in cameras]
    )
    bases, points = world_from_base @ fit.state.bases, world_from_base @ fit.state.points
    return replace(fit, state=replace(fit.state, mounts=mounts, bases=bases, points=points))


def _base_findings(cell: Cell, solution: Solution, fit: SceneFit) -> Iterator[Finding]:
    """Findings about the agreement of each base from the scene with the solution."""
    columns, covariance = fit.columns, scene_covariance(fit)
    for k, where in enumerate(columns.bases):
        if where is None:
            continue
        name = cell.base_name(fit.views.robots[k])
        if name in solution.observability.unobservable:
            yield from base_findings(name, None, np.eye(3))
        else:
            known = solution.transforms[name]
            apart = (known.mean.inverse() @ fit.state.bases[k]).translation
            yield from base_findings(name, apart, known.covariance[:3, :3] + covariance[where, where][:3, :3])


def _solve_jointly(cell: Cell, recording: Recording, last: Solution, fit: SceneFit, settings: Settings) -> Solution:
    """Solve with the scene and the other observations, starting from the solution without the scene."""
    views = fit.views
    seen = {camera.name: views.sample[views.camera == k].tolist() for k, camera in enumerate(views.cameras)}
    groups = scene_groups(cell, recording, last.problem, seen)
    settings = settings if last.noise.logs is not None else replace(settings, robot_noise="stated")
    problem, state = last.problem, _first_state(cell, last, fit)
    sigma_px = fit.sigma_px * widening_factor(fit)
    for _ in range(_LINEARISATIONS):
        problem = with_scene(problem, state, groups, fit, sigma_px)
        last = solve_at_mode(problem, state, settings, last.findings, last.noise)
        problem, state = last.problem, last.state
        groups = groups if problem.tied is None else problem.tied.groups
    return last


def _first_state(cell: Cell, solution: Solution, fit: SceneFit) -> State:
    """State of a solution; transforms and lenses that the solution does not determine are those of the scene."""
    state, views, missing = solution.state, fit.views, solution.observability.unobservable
    found = {cell.base_name(name): fit.state.bases[k] for k, name in enumerate(views.robots) if name != cell.reference}
    found |= {cell.mount_name(camera.name): fit.state.mounts[k] for k, camera in enumerate(views.cameras)}
    transforms = {name: found[name] if name in missing & found.keys() else at for name, at in state.transforms.items()}
    cameras = {camera.name: lens for camera, lens in zip(views.cameras, fit.state.lenses, strict=True)}
    return replace(state, transforms=transforms, cameras={**cameras, **state.cameras})


def _predicts_better(solution: Solution, iterations: int) -> bool:
    """Whether held-out views are predicted better with the scene than without it."""
    split = next(splits(solution.problem), None)
    if split is None:
        return True
    scores_without, scores_with = (
        score_stations(problem, solution.state, split, iterations).scores
        for problem in (replace(solution.problem, tied=None), solution.problem)
    )
    return compare_predicted_gains(scores_without - scores_with).gain > 0


def _explain_omission(findings: Sequence[Finding]) -> Finding:
    """Finding of a scene that is not used, with the last finding as the reason, which is the most serious."""
    if not findings:
        return Finding("scene-left-out", "info", (), "The scene does not improve the prediction of held-out views.")
    last = findings[-1]
    what = f"The scene is not used. {last.what}"
    return replace(last, code="scene-left-out", severity="info", what=what)
