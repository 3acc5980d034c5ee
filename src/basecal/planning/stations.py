"""Stations of programmed shifts that could be taken, with shifts of several lengths, to choose from for a task.

Source: "Base Calibration for Dual Robot System", section 2; docs/mathematics.md (15.1), (15.2).
"""

from __future__ import annotations

from collections.abc import Sequence

from basecal.cell import Sample
from basecal.errors import InputError
from basecal.planning.candidates import Taught, candidates
from basecal.planning.feasible import blocked_samples
from basecal.planning.shifts import DIRECTIONS, aim_camera, check_target, make_station, shift_length
from basecal.planning.sketch import Sketch

STATION_SAMPLES = len(DIRECTIONS)
"""Of a station."""

_ORIGIN_COUNT = 40  # half of them, and more, have a shift that leaves the image or the arm's reach
_LENGTH_FACTORS = (1.0, 2.0, 4.0)  # of the shift at which pixel noise and what the closed form neglects do least


def stations(sketch: Sketch, views: Sequence[Taught], seed: int = 0) -> list[Sample]:
    """Samples of feasible stations, one station after another.

    Args:
        sketch: What is known of the cell.
        views: States of all robots where the target was seen.
        seed: Of the draws.

    Raises:
        InputError: if no robot carries the target, or no station is feasible.
    """
    check_target(sketch)
    found = list[Sample]()
    for drawn in candidates(sketch, views, _ORIGIN_COUNT, seed):
        origin = aim_camera(sketch, drawn)
        for times in _LENGTH_FACTORS if origin is not None else ():
            assert origin is not None
            station = make_station(sketch, origin, times * shift_length(sketch, origin))
            if station is None:
                break
            if not blocked_samples(sketch, station[0].robots, station):
                found += station
    if not found:
        raise InputError("no station can be shifted from: teach poses farther from the arms' limits")
    return found
