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
from basecal.vision.image_file import grey_image, read_bytes

_SHOWN = 10  # samples in a sentence

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
    samples, findings, missed = [], [*recording.findings], dict[tuple[str, str], list[int]]()
    for done, sample in enumerate(recording.samples, start=1):
        seen = [_camera(look, sample, camera) for camera in sample.images]
        found = [each for view in seen for each in view.found]
        samples.append(replace(sample, observations=(*sample.observations, *found)) if found else sample)
        findings += [finding for view in seen for finding in view.findings]
        for view in seen:
            for pair in view.missed:
                missed.setdefault(pair, []).append(sample.sample)
        if progress is not None:
            progress(done, len(recording.samples))
    for (camera, target), where in missed.items():
        few = ", ".join(map(str, where[:_SHOWN])) + (", ..." if len(where) > _SHOWN else "")
        message = f"{target!r} is not found in {len(where)} images of {camera!r}: samples {few}"
        findings.append(Finding("dropped-sample", "info", (camera, target), message))
    return replace(recording, samples=tuple(samples), findings=tuple(findings))


@dataclass(frozen=True, eq=False)
class _Look:
    cell: Cell
    targets: Mapping[str, Target]
    folder: Path


@dataclass(frozen=True, eq=False)
class _View:
    """What one image of a sample shows: observations, pairs of camera and target without one, and what is amiss."""

    found: tuple[Observation, ...] = ()
    missed: tuple[tuple[str, str], ...] = ()
    findings: tuple[Finding, ...] = ()


def _camera(look: _Look, sample: Sample, camera: str) -> _View:
    known = {each.target for each in sample.observations if each.camera == camera}
    open_targets = {name: target for name, target in look.targets.items() if name not in known}
    # Without a lens, pixels say nothing.
    if not open_targets or look.cell.cameras[camera].intrinsics is None:
        return _View()
    data = _bytes(look, sample, camera, sample.images[camera])
    if isinstance(data, Finding):
        return _View(findings=(data,))
    needs_dark = camera in sample.background and any(target.found_by == LIGHT for target in open_targets.values())
    off = _bytes(look, sample, camera, sample.background[camera]) if needs_dark else None
    if isinstance(off, Finding):
        return _View(findings=(off,))
    found: list[Observation] = []
    missed = []
    for name, target in open_targets.items():
        one = _detection(look, sample, camera, target, data, off if target.found_by == LIGHT else None)
        if isinstance(one, Finding):
            return _View(findings=(one,))
        seen = one[0]
        if seen is None:
            missed.append((camera, name))
        elif seen.ids is None:
            found.append(CandidateObservation(camera, name, seen.pixels, seen.sigma_px, detected=True))
        else:
            found.append(PixelObservation(camera, name, seen.ids, seen.pixels, seen.sigma_px, detected=True))
    return _View(tuple(found), tuple(missed))


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
