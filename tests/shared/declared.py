"""The reading of a cell and its recording as declared."""

from basecal.accuracy.readings.reading import Reading, declared_reading
from basecal.cell import Cell, Recording
from basecal.estimation.problem.build import build_problem


def declared(cell: Cell, recording: Recording) -> Reading:
    """The reading of a cell and its recording, packed."""
    return declared_reading(cell, recording, build_problem(cell, recording)[0])
