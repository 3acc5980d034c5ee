"""Choice of the transforms of a calibration for export, and of their frame names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from basecal.cell import Calibration, Cell
from basecal.errors import FrameNotFound, InputError
from basecal.exchange.exports.exporter import NamedTransform
from basecal.geometry import PoseEstimate


def chosen_transforms(
    calibration: Calibration, cell: Cell | None = None, name: str | None = None
) -> tuple[NamedTransform, ...]:
    """Choose a transform by name in either direction, or without a name all requested transforms.

    Several frames of one name in other programs have their names in the cell.

    Args:
        calibration: The calibration.
        cell: The calibrated cell, for the requested transforms and names of frames. Without it, all estimated bases
            are requested, or all estimated transforms if there are no bases.
        name: Name of a transform in the calibration, the name of its inverse, or `a_from_b` of any two rigidly
            connected frames.

    Raises:
        FrameNotFound: if a frame does not exist.
        InputError: if the transform is the position of a point, its frames are not rigidly connected, or there is
            nothing to export.
    """
    if name is not None:
        return (_find_transform(calibration, cell, name),)
    if cell is not None:
        requested = list(cell.requested_transforms)
    else:
        estimated = [each for each in calibration.transforms if calibration.status.get(each) != "fixed"]
        bases = [each for each in estimated if all(frame.endswith("_base") for frame in each.split("_from_"))]
        requested = bases or estimated
    names = [each for each in requested if each in calibration.transforms and each not in calibration.points]
    if not names:
        known = ", ".join(calibration.transforms) or "none"
        raise InputError(f"no transform was estimated that could be exported; name one of: {known}")
    found = [_find_transform(calibration, cell, each) for each in names]
    distinct = distinct_names(found)
    return tuple(
        replace(each, parent=distinct[own[0]], child=distinct[own[1]]) for each in found for own in [each.own_frames]
    )


def distinct_names(transforms: Sequence[NamedTransform], valid_name: Callable[[str], str] = str) -> dict[str, str]:
    """Names of frames in other programs, by their names in the cell, which replace those of several frames.

    Args:
        transforms: The transforms between the frames.
        valid_name: Function from a name to a name that the program allows; empty if it reserves the name.
    """
    external: dict[str, str] = {}
    for transform in transforms:
        external |= zip(transform.own_frames, map(valid_name, (transform.parent, transform.child)), strict=True)
    counts = Counter(external.values())
    return {frame: name if name and counts[name] == 1 else frame for frame, name in external.items()}


def both_directions(calibration: Calibration, cell: Cell | None = None) -> tuple[NamedTransform, ...]:
    """All transforms of a calibration that can be exported, each followed by its inverse."""
    known = {name for name, estimate in calibration.transforms.items() if _is_covariance(estimate)}
    names = [name for name in calibration.transforms if name in known and name not in calibration.points]
    return tuple(_find_transform(calibration, cell, each) for name in names for each in (name, _reverse_name(name)))


def frame_names(cell: Cell, name: str) -> tuple[str, str]:
    """Names of a transform's parent and child in other programs.

    They are the `frames` of robots and the `frame` of cameras in the cell. The cell's own names are used if these are
    missing, or if both would be equal.
    """
    ours = tuple(name.split("_from_"))
    named = {f"{robot.name}_{part}": other for robot in cell.robots.values() for part, other in robot.frames.items()}
    named |= {camera.name: camera.frame for camera in cell.cameras.values() if camera.frame is not None}
    parent, child = (named.get(frame, frame) for frame in ours)
    return (parent, child) if parent != child else (ours[0], ours[1])


def _find_transform(calibration: Calibration, cell: Cell | None, name: str) -> NamedTransform:
    inverse = _reverse_name(name)
    stored = name if name in calibration.transforms else inverse
    if stored not in calibration.transforms:
        parent, separator, child = name.partition("_from_")
        if not separator:
            raise FrameNotFound(name, list(calibration.transforms))
        if parent == child:
            raise InputError(f"{name} has one frame twice: name two, such as {next(iter(calibration.transforms), '')}")
        estimate = calibration.frame_between(parent, child)
        if not _is_covariance(estimate):
            raise InputError(f"the covariance of {name} is none, a variance is negative or not finite: calibrate again")
        return _make_transform(cell, name, estimate, "free" if np.any(estimate.covariance) else "fixed")
    if stored in calibration.points:
        raise InputError(f"{stored} is the place of a point and has no rotation: there is no pose to export")
    if not _is_covariance(calibration[stored]):
        raise InputError(f"the covariance of {stored} is none, a variance is negative or not finite: calibrate again")
    estimate = calibration[stored] if stored == name else calibration[stored].inverse()
    return _make_transform(cell, name, estimate, calibration.status.get(stored, "free"))


def _make_transform(cell: Cell | None, name: str, estimate: PoseEstimate, status: str) -> NamedTransform:
    parent, child = name.split("_from_") if cell is None else frame_names(cell, name)
    return NamedTransform(name, parent, child, estimate, status)


def _is_covariance(estimate: PoseEstimate) -> bool:
    """Whether the covariance is finite with non-negative variances; that of a damaged file may not be."""
    if not np.all(np.isfinite(estimate.covariance)):
        return False
    return all(np.all(np.diag(each.covariance) >= 0) for each in (estimate, estimate.inverse()))


def _reverse_name(name: str) -> str:
    return "_from_".join(reversed(name.split("_from_")))
