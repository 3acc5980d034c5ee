"""Samples that could be taken."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Sample
from basecal.errors import InputError
from basecal.estimation.settings import Settings
from basecal.planning.candidates import candidates
from basecal.planning.feasible import is_feasible
from basecal.planning.prospects import sketches
from basecal.simulation import Scenario, simulate


def made(**scenario):
    """A sketch of a calibrated cell, and where its robots stood."""
    simulated = simulate(Scenario(samples=12, **scenario), 3)
    sketch = sketches(simulated.cell, calibrate(simulated.cell, simulated.recording, Settings(robot_noise="stated")))[0]
    return sketch, [dict(sample.robots) for sample in simulated.recording.samples]


@pytest.mark.parametrize("scenario", [{}, {"joints": True}, {"layout": "eye_to_hand"}, {"layout": "eye_in_hand"}])
def test_every_candidate_is_feasible(scenario):
    """Of arms sent by poses and by joints, and of a camera or a target on the world; numbered, none twice."""
    sketch, taught = made(**scenario)
    found = candidates(sketch, taught, 30, seed=1)
    assert len(found) == 30
    assert [sample.sample for sample in found] == list(range(30))
    for sample in found:
        assert is_feasible(sketch, sample)
        for robot, state in sample.robots.items():
            assert (state.joints_rad is None) == (taught[0][robot].joints_rad is None)
    places = [sketch.camera_from_target(sample).matrix.round(9).tobytes() for sample in found]
    assert len(set(places)) == 30


def test_draws_are_those_of_the_seed():
    """The same again, and others by another."""
    sketch, taught = made()
    first, again, other = (candidates(sketch, taught, 5, seed=s) for s in (1, 1, 2))
    at = [np.stack([sketch.camera_from_target(s).matrix for s in found]) for found in (first, again, other)]
    assert (at[0] == at[1]).all()
    assert not (at[0] == at[2]).all(axis=(-1, -2)).any()


def test_poses_that_do_not_see_the_target_teach_nothing():
    """Both arms far from where the target is in view: it is said what to do."""
    sketch, taught = made()
    turned = {robot: type(state)(state.base_from_flange.inverse()) for robot, state in taught[0].items()}
    assert not is_feasible(sketch, Sample(0, robots=turned))
    with pytest.raises(InputError, match="Teach poses"):
        candidates(sketch, [turned], 5)
