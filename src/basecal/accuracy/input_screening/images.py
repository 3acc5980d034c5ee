"""Images of a recording: whether to search them for targets, and how many can be searched."""

from __future__ import annotations

from basecal.accuracy.input_screening.units import impossible_units
from basecal.cell import Cell, Recording


def needs_search(cell: Cell, recording: Recording) -> bool:
    """Whether a recording has images, and units that leave the verdict open."""
    return any(sample.images for sample in recording.samples) and not impossible_units(cell, recording)


def count_searchable_images(cell: Cell, recording: Recording) -> int:
    """How many images were taken through a known kind of lens, if the cell has a target that images show."""
    if not any(each.target is not None and each.target.found_by is not None for each in cell.targets.values()):
        return 0
    cameras = {name for name, camera in cell.cameras.items() if camera.intrinsics is not None}
    return sum(len(cameras & sample.images.keys()) for sample in recording.samples)
