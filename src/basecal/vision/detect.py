"""Observations from images: of every sample, of every target a camera can see, where there are none yet."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from basecal.cell.calibration import Finding
from basecal.cell.cell import Cell
from basecal.cell.recording import CandidateObservation, Observation, PixelObservation, Recording, Sample
from basecal.cell.target import Target
from basecal.errors import InputError
from basecal.vision import cache
from basecal.vision.detection import Detection, Image
from basecal.vision.detectors import LIGHT, find
from basecal.vision.image_file import grey_image, is_turned, read_bytes
from basecal.vision.losses import Searched, lost_images

Progress = Callable[[int, int], None]
"""Called with how many samples of how many are done."""


def detect(
    cell: Cell, recording: Recording, folder: Path | str | None = None, progress: Progress | None = None
) -> Recording:
    """A recording with what its images show.

    An observation that is there already stays, and its image is not read. A view in which a target is not found gets
    no observation; all others keep their own sample. An image that cannot be used is left out with a finding.

    Args:
        cell: Its cameras and targets.
        recording: Its samples.
        folder: The cell's folder, from which the images' paths count and where detections are kept in `derived/`;
            the one that the recording was read from where None.
        progress: Called after every sample.

    Raises:
        InputError: if a target cannot be detected as it is described, or it is not known where the images are.
    """
    shapes = {name: entry.target for name, entry in cell.targets.items() if entry.target is not None}
    sought = {name: target for name, target in shapes.items() if target.found_by is not None}
    if folder is None and recording.folder is None and any(sample.images for sample in recording.samples):
        raise InputError("it is not known where the images are; give the folder of the cell")
    look = _Look(cell, sought, Path(folder or recording.folder or "."))
    samples, findings, searched = [], [*recording.findings], list[Searched]()
    for done, sample in enumerate(recording.samples, start=1):
        seen = [view for camera in sample.images if (view := _camera(look, sample, camera)) is not None]
        found = [each for view in seen for each in view.found]
        samples.append(replace(sample, observations=(*sample.observations, *found)) if found else sample)
        findings += [view.unusable for view in seen if view.unusable is not None]
        searched += [view.searched for view in seen]
        if progress is not None:
            progress(done, len(recording.samples))
    lost = list(lost_images(searched, sought, look.folder))
    grave = [finding for finding in lost if finding.severity == "warning"]
    others = [finding for finding in lost if finding.severity != "warning"]
    return replace(recording, samples=tuple(samples), findings=(*grave, *findings, *others))


@dataclass(frozen=True, eq=False)
class _Look:
    cell: Cell
    targets: Mapping[str, Target]
    folder: Path


@dataclass(frozen=True, eq=False)
class _View:
    """What an image of a sample shows, or why it cannot be used."""

    searched: Searched
    found: tuple[Observation, ...] = ()
    unusable: Finding | None = None


def _camera(look: _Look, sample: Sample, camera: str) -> _View | None:
    """What one image of a sample shows; None where there is nothing to look for."""
    known = {each.target for each in sample.observations if each.camera == camera}
    open_targets = {name: target for name, target in look.targets.items() if name not in known}
    # Without a lens, pixels say nothing.
    if not open_targets or look.cell.cameras[camera].intrinsics is None:
        return None
    searched = Searched(sample.sample, camera, sample.images[camera])
    images = _images(look, sample, camera, needs_dark=any(each.found_by == LIGHT for each in open_targets.values()))
    if isinstance(images, Finding):
        return _View(searched, unusable=images)
    data, off = images
    found: list[Observation] = []
    missed = []
    for name, target in open_targets.items():
        one = _detection(look, sample, camera, target, data, off if target.found_by == LIGHT else None)
        if isinstance(one, Finding):
            return _View(searched, unusable=one)
        seen = one[0]
        if seen is None:
            missed.append(name)
        elif seen.ids is None:
            found.append(CandidateObservation(camera, name, seen.pixels, seen.sigma_px, detected=True))
        else:
            found.append(PixelObservation(camera, name, seen.ids, seen.pixels, seen.sigma_px, detected=True))
    names = tuple(each.target for each in found)
    return _View(replace(searched, found=names, missed=tuple(missed), turned=is_turned(data)), tuple(found))


def _images(look: _Look, sample: Sample, camera: str, needs_dark: bool) -> tuple[bytes, bytes | None] | Finding:
    """The image and, where it is needed and there is one, the image without a light; or why one cannot be used."""
    data = _bytes(look, sample, camera, sample.images[camera])
    if isinstance(data, Finding) or not needs_dark or camera not in sample.background:
        return data if isinstance(data, Finding) else (data, None)
    off = _bytes(look, sample, camera, sample.background[camera])
    return off if isinstance(off, Finding) else (data, off)


def _bytes(look: _Look, sample: Sample, camera: str, path: str) -> bytes | Finding:
    data = read_bytes(look.folder / path)
    return _unusable(sample, camera, path, data) if isinstance(data, str) else data


def _detection(
    look: _Look, sample: Sample, camera: str, target: Target, data: bytes, off: bytes | None
) -> tuple[Detection | None] | Finding:
    """The detection, in a tuple since it may be None, or why an image cannot be used."""
    size_px = look.cell.cameras[camera].size_px
    name = cache.key(target, size_px, data, off)
    if (kept := cache.read(look.folder, name)) is not None:
        return kept
    image = grey_image(data, size_px)
    if isinstance(image, str):
        return _unusable(sample, camera, sample.images[camera], image)
    background: Image | str | None = None if off is None else grey_image(off, size_px)
    if isinstance(background, str):
        return _unusable(sample, camera, sample.background[camera], background)
    if background is not None and (background.shape, background.dtype) != (image.shape, image.dtype):
        return _unusable(sample, camera, sample.background[camera], "differs in size or bits from the image it is for")
    detection = find(image, target, background)
    cache.write(look.folder, name, detection)
    return (detection,)


def _unusable(sample: Sample, camera: str, path: str, reason: str) -> Finding:
    message = f"sample {sample.sample}: {path} {reason}; what {camera!r} saw then is left out"
    return Finding("dropped-sample", "info", (str(sample.sample), camera), message)
