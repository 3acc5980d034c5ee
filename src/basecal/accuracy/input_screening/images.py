"""Whether a recording's images are worth the minutes that a search of them takes."""

from __future__ import annotations

from basecal.accuracy.input_screening.units import impossible_units
from basecal.cell import Cell, Recording


def needs_search(cell: Cell, recording: Recording) -> bool:
    """Whether a recording has images, and units that leave the verdict open."""
    return any(sample.images for sample in recording.samples) and not impossible_units(cell, recording)
