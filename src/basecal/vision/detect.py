"""Detection of all targets in the images of all samples that have no observations yet."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from basecal.cell.cell import Cell
from basecal.cell.recording import CandidateObservation, Observation, PixelObservation, Recording, Sample
from basecal.cell.recording_check import check_recording
from basecal.cell.target import Target
from basecal.errors import InputError
from basecal.vision import cache
from basecal.vision.detection import Detection, Image
from basecal.vision.detectors import LED, find_target
from basecal.vision.image_file import grey_image, is_turned, read_bytes
from basecal.vision.losses import SearchedImage, explain_no_target, image_findings

Progress = Callable[[int, int], None]
"""Callback with the number of completed steps and the total number of steps."""

# Samples that are searched first, spread over the recording. If none shows a target and the cause is known, the others
# are not searched, which saves minutes. If 30 % of the images show a target, all of these miss it with a probability of
# 0.06; the search then ends wrongly only if a wrong cause is found, too.
_FIRST_SAMPLES = 8
_PREVIEW_SAMPLES = 20  # fewest samples of a recording for this preview; fewer are searched within seconds


def detect(
    cell: Cell, recording: Recording, folder: Path | str | None = None, progress: Progress | None = None
) -> Recording:
    """Detect targets in the images of a recording and add the observations to a copy.

    Existing observations are kept, and their targets are not searched. A target that is not found gets no observation.
    An image that cannot be used is left out with a finding. If the first searched images show no target and the cause
    is known, the others are not searched.

    Args:
        cell: The cell with cameras and targets.
        recording: The samples.
        folder: The cell's folder, to which the images' paths are relative; `derived/` in it caches detections. If None,
            the folder that the recording was read from.
        progress: Called after every sample, and once after the diagnosis of images without targets.

    Raises:
        InputError: if an argument has a wrong type, a target cannot be detected as described, or the folder of the
            images is unknown.
    """
    check_recording(cell, recording)
    shapes = {name: entry.target for name, entry in cell.targets.items() if entry.target is not None}
    detectable = {name: target for name, target in shapes.items() if target.found_by is not None}
    if folder is None and recording.folder is None and any(sample.images for sample in recording.samples):
        raise InputError("the folder of the images is unknown; give the folder of the cell")
    search = _Search(cell, detectable, Path(folder or recording.folder or "."))
    samples = list(recording.samples)
    searched: list[SearchedImage] = []
    for done, index in enumerate(_search_order(len(samples)), start=1):
        sample = samples[index]
        views = [view for camera in sample.images if (view := _search_image(search, sample, camera)) is not None]
        observations = [each for view in views for each in view.observations]
        if observations:
            samples[index] = replace(sample, observations=(*sample.observations, *observations))
        searched += [view.searched for view in views]
        if progress is not None:
            progress(done, len(samples) + 1)
        if (
            done == _FIRST_SAMPLES
            and len(samples) >= _PREVIEW_SAMPLES
            and explain_no_target(searched, detectable, search.folder)
        ):
            break
    searched.sort(key=lambda image: image.sample)
    findings = list(image_findings(searched, detectable, search.folder))
    if progress is not None:
        progress(len(samples) + 1, len(samples) + 1)
    grave = [finding for finding in findings if finding.severity == "warning"]
    others = [finding for finding in findings if finding.severity != "warning"]
    return replace(recording, samples=tuple(samples), findings=(*grave, *recording.findings, *others))


def _search_order(count: int) -> list[int]:
    """Indices of samples in search order: a few spread over the recording, then the others in order."""
    first = dict.fromkeys(np.linspace(0, count - 1, min(_FIRST_SAMPLES, count)).astype(int).tolist())
    return [*first, *(index for index in range(count) if index not in first)]


@dataclass(frozen=True, eq=False)
class _Search:
    cell: Cell
    targets: Mapping[str, Target]
    folder: Path


@dataclass(frozen=True, eq=False)
class _View:
    """Result of the search in an image of a sample."""

    searched: SearchedImage
    observations: tuple[Observation, ...] = ()


def _search_image(search: _Search, sample: Sample, camera: str) -> _View | None:
    """Search one image of a sample; None if it has no target to search for or its camera has no lens."""
    observed_names = {each.target for each in sample.observations if each.camera == camera}
    missing_targets = {name: target for name, target in search.targets.items() if name not in observed_names}
    # Without a lens, pixels are not usable.
    if not missing_targets or search.cell.cameras[camera].intrinsics is None:
        return None
    searched = SearchedImage(sample.sample, camera, sample.images[camera])
    try:
        source = _read_source(search, sample.images[camera])
        needs_dark = camera in sample.background and any(each.found_by == LED for each in missing_targets.values())
        dark = _read_source(search, sample.background[camera]) if needs_dark else None
        detections = {
            name: _detection(search, camera, target, source, dark if target.found_by == LED else None)
            for name, target in missing_targets.items()
        }
    except _Unusable as error:
        return _View(replace(searched, path=error.path, unusable=error.reason))
    observations: list[Observation] = []
    for name, each in detections.items():
        if each is not None and each.ids is None:
            observations.append(CandidateObservation(camera, name, each.pixels, each.sigma_px, detected=True))
        elif each is not None and each.ids is not None:
            observations.append(PixelObservation(camera, name, each.ids, each.pixels, each.sigma_px, detected=True))
    missed = tuple(name for name, each in detections.items() if each is None)
    names = tuple(each.target for each in observations)
    return _View(replace(searched, found=names, missed=missed, turned=is_turned(source.data)), tuple(observations))


class _Unusable(Exception):
    """An image that cannot be used, with its path and the reason."""

    def __init__(self, path: str, reason: str) -> None:
        super().__init__(reason)
        self.path, self.reason = path, reason


class _Source(NamedTuple):
    """The file of an image."""

    path: str
    data: bytes

    def image(self, size_px: tuple[int, int] | None) -> Image:
        """Grey levels of the image; see `grey_image`.

        Raises:
            _Unusable: if the image cannot be decoded or has another size.
        """
        image = grey_image(self.data, size_px)
        if isinstance(image, str):
            raise _Unusable(self.path, image)
        return image


def _read_source(search: _Search, path: str) -> _Source:
    data = read_bytes(search.folder / path)
    if isinstance(data, str):
        raise _Unusable(path, data)
    return _Source(path, data)


def _detection(search: _Search, camera: str, target: Target, source: _Source, dark: _Source | None) -> Detection | None:
    """The detection of a target in an image, from the cache or by search.

    Raises:
        _Unusable: if an image cannot be used.
    """
    size_px = search.cell.cameras[camera].size_px
    name = cache.key(target, size_px, source.data, None if dark is None else dark.data)
    if (cached := cache.read(search.folder, name)) is not None:
        return cached[0]
    image, background = source.image(size_px), None
    if dark is not None:
        background = dark.image(size_px)
        if (background.shape, background.dtype) != (image.shape, image.dtype):
            raise _Unusable(dark.path, "differs in size or bits from the image it is for")
    detection = find_target(image, target, background)
    cache.write(search.folder, name, detection)
    return detection
