"""Findings about images without detections: their number, samples, and likely content."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from basecal.cell.calibration import Finding
from basecal.cell.target import Target
from basecal.errors import count_text, sentence
from basecal.vision.detection import eight_bit
from basecal.vision.detectors import describe_other_targets
from basecal.vision.image_file import grey_image, read_bytes
from basecal.vision.kinds.preprocessing import Grey
from basecal.vision.survey import describe_print_error

_MANY_SHARE = 1 / 3  # of a camera's images without any target: targets rarely leave the view that often
_MOST_SHARE = 1 / 2  # of a camera's images: above, the images may show another target than the stated one
_SURVEYED_IMAGES = 3  # images that are searched for other targets, spread over the recording
_ADVICE = "look at light, focus and distance, and whether cell.yaml describes the target as it is printed"
_REPLACEMENT = "replace these images, or remove them from the recording"
_SHOWN_SAMPLES = 10  # samples listed in a sentence


@dataclass(frozen=True)
class SearchedImage:
    """An image that was searched.

    Attributes:
        sample: Number of the sample.
        camera: Name of the camera.
        path: Path relative to the cell's folder.
        found: Names of the detected targets.
        missed: Names of the targets that were not found.
        turned: Whether the EXIF orientation rotates or mirrors it.
        unusable: Why it cannot be used; empty if it can.
    """

    sample: int
    camera: str
    path: str
    found: tuple[str, ...] = ()
    missed: tuple[str, ...] = ()
    turned: bool = False
    unusable: str = ""


def image_findings(searches: Sequence[SearchedImage], targets: Mapping[str, Target], folder: Path) -> Iterator[Finding]:
    """Findings about images without detections, most severe first.

    Args:
        searches: All searched images.
        targets: The targets by name.
        folder: The cell's folder, to which the images' paths are relative.
    """
    by_camera: dict[str, list[SearchedImage]] = {}
    for image in searches:
        by_camera.setdefault(image.camera, []).append(image)
    for camera, images in by_camera.items():
        yield from _few_images(camera, images, targets, folder)
    for camera, images in by_camera.items():
        for reason, selection in _group_by_reason(images).items():
            about = (*(str(image.sample) for image in selection), camera)
            what = sentence(f"{_sample_phrase(selection, images)} {reason}")
            subject = "It is" if len(selection) == 1 else "They are"
            yield Finding("dropped-sample", "info", about, what, why=f"{subject} left out for {camera!r}.")
        if turned := [image.sample for image in images if image.turned]:
            what = (
                f"EXIF rotates {count_text(len(turned), 'image')} of {camera!r} for display: {_list_samples(turned)}."
            )
            why = "They are searched as the sensor gave them."
            do = ("State the lens of images as the sensor gives them.",)
            yield Finding("turned-images", "info", (camera,), what, do, why)
        for name in dict.fromkeys(name for image in images for name in image.missed):
            missing = [image for image in images if name in image.missed]
            samples = _list_samples([image.sample for image in missing])
            what = f"{name!r} is not found in {count_text(len(missing), 'image')} of {camera!r}: {samples}."
            print_error = describe_print_error(_read_images(missing[:_SURVEYED_IMAGES], folder), targets[name])
            if print_error is None:
                yield Finding("dropped-sample", "info", (camera, name), what)
            else:
                cause, _, cure = print_error.partition(": ")
                yield Finding("dropped-sample", "warning", (camera,), what, (sentence(cure),), sentence(cause))


def explain_no_target(searches: Sequence[SearchedImage], targets: Mapping[str, Target], folder: Path) -> str:
    """Explain why images show no target, as the end of a sentence; empty if one does or the cause is unknown."""
    if not searches or any(image.found for image in searches):
        return ""
    return "; ".join([*_reasons(searches), *_hints(searches, targets, folder)])


def _few_images(
    camera: str, images: Sequence[SearchedImage], targets: Mapping[str, Target], folder: Path
) -> Iterator[Finding]:
    empty = [image for image in images if not image.found]
    if len(empty) <= _MANY_SHARE * len(images):
        return
    what = f"{len(empty)} of {len(images)} images of {camera!r} show no target."
    why = " ".join(map(sentence, _reasons(empty)))
    hints = _hints(empty, targets, folder) if len(empty) > _MOST_SHARE * len(images) else []
    do = hints or [_REPLACEMENT if why else _ADVICE]
    yield Finding("few-images", "warning", (camera,), what, tuple(map(sentence, do)), why)


def _reasons(images: Sequence[SearchedImage]) -> list[str]:
    """Reasons why images cannot be used, each once, most frequent first."""
    by_reason = _group_by_reason(images)
    by_frequency = sorted(by_reason.items(), key=lambda each: -len(each[1]))
    return [f"{_sample_phrase(selection, images)} {reason}" for reason, selection in by_frequency]


def _group_by_reason(images: Sequence[SearchedImage]) -> dict[str, list[SearchedImage]]:
    by_reason: dict[str, list[SearchedImage]] = {}
    for image in images:
        if image.unusable:
            by_reason.setdefault(image.unusable, []).append(image)
    return by_reason


def _sample_phrase(selection: Sequence[SearchedImage], images: Sequence[SearchedImage]) -> str:
    """Phrase for a selection of images: a path, and the samples if not all images are selected."""
    if len(selection) == 1:
        return f"sample {selection[0].sample}: {selection[0].path}"
    which = (
        "each of them" if len(selection) == len(images) else f"each of {_list_samples([i.sample for i in selection])}"
    )
    return f"{which}, such as {selection[0].path},"


def _hints(empty: Sequence[SearchedImage], targets: Mapping[str, Target], folder: Path) -> list[str]:
    """Describe the content of images in which a target is not found, for each target if it can be determined."""
    hints = []
    for name, target in targets.items():
        missed = [image for image in empty if name in image.missed]
        some = missed[:: max(1, len(missed) // _SURVEYED_IMAGES)][:_SURVEYED_IMAGES]
        hint = describe_other_targets(_read_images(some, folder), target)
        hints += [f"{name!r}: {hint}"] if hint else []
    return hints


def _read_images(images: Sequence[SearchedImage], folder: Path) -> list[Grey]:
    """Read images in 8 bits, without those that cannot be read."""
    grey = [grey_image(read_bytes(folder / image.path), None) for image in images]
    return [eight_bit(image) for image in grey if not isinstance(image, str)]


def _list_samples(samples: Sequence[int]) -> str:
    shown = ", ".join(map(str, samples[:_SHOWN_SAMPLES])) + (", ..." if len(samples) > _SHOWN_SAMPLES else "")
    return f"sample {shown}" if len(samples) == 1 else f"samples {shown}"
