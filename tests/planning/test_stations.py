"""Stations of shifts that could be taken."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell import Calibration
from basecal.errors import InputError
from basecal.geometry import PoseEstimate
from basecal.planning.feasible import is_feasible
from basecal.planning.prospects import sketches
from basecal.planning.stations import STATION_SAMPLES, stations
from basecal.simulation import Scenario, simulate


def guessed(layout="dual"):
    """The sketch of a cell at its truth, and where its target was seen."""
    made = simulate(Scenario(samples=5, layout=layout), 3)
    known = Calibration("doubtful", {name: PoseEstimate(mean, np.eye(6)) for name, mean in made.truth.items()})
    return sketches(made.cell, known)[0], [dict(sample.robots) for sample in made.recording.samples]


def test_stations_are_whole_and_can_be_taken():
    """Seven samples each, all feasible; several lengths of shift are among them."""
    sketch, taught = guessed()
    found = stations(sketch, taught)
    assert len(found) % STATION_SAMPLES == 0
    assert all(is_feasible(sketch, sample) for sample in found)
    first = [sketch.camera_from_target(sample).translation for sample in found]
    lengths = [np.linalg.norm(first[k + 1] - first[k]) for k in range(0, len(first), STATION_SAMPLES)]
    assert max(lengths) > 1.9 * min(lengths)


def test_a_target_that_stays_cannot_be_shifted():
    """A board on the world has no stations."""
    with pytest.raises(InputError, match="on the world"):
        stations(*guessed("eye_in_hand"))
