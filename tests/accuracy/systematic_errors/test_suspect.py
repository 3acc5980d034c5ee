"""What a suspect counts for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.systematic_errors.place_scatter import PlaceScatter
from basecal.accuracy.systematic_errors.suspect import Suspect
from basecal.effects.faces.candidates import Candidates

ONE = Suspect(
    "step", Candidates("base-moved", ("a",), (3,), "", (None,)), np.zeros(6), 6, 60.0, -20.0, -22.0, np.log(32)
)


def test_one_of_many_ranks_behind():
    """By half the logarithm of their number."""
    assert ONE.rank == pytest.approx(-22.0 + 0.5 * np.log(32))


def test_a_change_in_time_is_judged_by_the_larger_of_score_and_gain():
    """Beside what differs by place; other errors keep their chance."""
    moved = replace(ONE, scatter=PlaceScatter(2.0, 50.0))
    assert ONE.log_chance_beside_places(90.0, -31.0) == -31.0
    assert moved.log_chance_beside_places(10.0, -31.0) == pytest.approx(
        PlaceScatter(1.0, 50.0).log_chance(30.0, 6) + np.log(32)
    )
    assert moved.log_chance_beside_places(90.0, -31.0) == pytest.approx(
        PlaceScatter(1.0, 50.0).log_chance(45.0, 6) + np.log(32)
    )
