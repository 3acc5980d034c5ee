"""Points of a scene stored with a calibration, and new images as observations of these points for `verify`.

The points share the errors of the calibration that found them. Both errors count in full, as if independent. Checks
therefore raise no false alarms from this correlation, and are slightly less sensitive.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.scene.images import Images, read_images
from basecal.cell import WORLD, Calibration, Cell, CellTarget, PixelObservation, Recording, Unknown
from basecal.cell.fingerprint import Fingerprint
from basecal.cell.targets.points import points_target
from basecal.estimation.scene.adjust import SceneFit
from basecal.geometry import SE3, Array, Camera
from basecal.numerics.batch import take
from basecal.numerics.robust_step import NORMAL_MAD
from basecal.vision.tracks.features import Descriptors, descriptor_levels, unit_descriptors
from basecal.vision.tracks.locating import locate_camera

_WIDENING = 1.5  # of the image points' sigma about the image's own pose, as the points have errors, too; assumed


def scene_fingerprint(images: Images, fit: SceneFit, points: Array) -> Fingerprint:
    """Return the points of a scene, (p, 3) in the world [m], with their descriptors."""
    moving = fit.views.robot[fit.tracks.view] >= 0
    return Fingerprint(points, descriptor_levels(images.descriptors(take(fit.tracks, moving))))


def with_scene_as_target(
    cell: Cell, calibration: Calibration, recording: Recording, fingerprint: Fingerprint
) -> tuple[Cell, Recording]:
    """Add the scene to the cell as a target on `world`, and its image points to the recording as observations.

    Args:
        cell: The calibrated cell.
        calibration: Its calibration, with estimated lenses.
        recording: New samples, with images or tracks.
        fingerprint: Points of the scene at the calibration.

    Returns:
        The cell with the target, and the recording with the observations.
    """
    target = CellTarget(
        _free_name(cell), WORLD, Unknown("fixed", SE3.identity()), points_target(fingerprint.points), 0.0
    )
    extended = replace(cell, targets={**cell.targets, target.name: target})
    images = read_images(cell, recording)
    descriptors = unit_descriptors(fingerprint.descriptors)
    seen: dict[int, list[PixelObservation]] = {}
    for row, (sample_number, index) in enumerate(zip(images.views.sample, images.views.camera, strict=True)):
        name = images.views.cameras[index].name
        lens = calibration.cameras[name][0] if name in calibration.cameras else images.lenses[index]
        found = _observe_scene(images, row, lens, descriptors, target)
        if found is not None:
            seen.setdefault(int(sample_number), []).append(found)
    samples = (
        replace(each, observations=(*each.observations, *seen.get(each.sample, []))) for each in recording.samples
    )
    return extended, replace(recording, samples=tuple(samples))


def _free_name(cell: Cell) -> str:
    """Return a target name that the cell does not use."""
    return next(name for name in ("scene", "static_scene", "old_scene") if name not in cell.targets)


def _observe_scene(
    images: Images, row: int, lens: Camera, descriptors: Descriptors, target: CellTarget
) -> PixelObservation | None:
    """Return the observation of the scene in an image; None if the image shows too few points."""
    assert target.target is not None
    features, points = images.features[row], target.target.points
    found = locate_camera(features, descriptors, points, lens)
    if found is None:
        return None
    pixels = features.pixels[found.feature]
    off = lens.project(found.camera_from_world @ points[found.point]) - pixels
    sigma_px = _WIDENING * NORMAL_MAD * float(np.median(np.abs(off)))
    name = images.views.cameras[images.views.camera[row]].name
    order = np.argsort(found.point)
    return PixelObservation(name, target.name, found.point[order], pixels[order], np.full(len(order), sigma_px))
