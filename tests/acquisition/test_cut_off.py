"""Captures that are killed."""

from __future__ import annotations

import pytest

from shared.kill_trial import kill_trial


@pytest.mark.slow  # that each sample is written when it is told is tried without kills by test_capture
@pytest.mark.parametrize(("samples", "kills"), [(2, 2), (12, 40)])
def test_nothing_that_was_told_is_lost(tmp_path, samples, kills):
    """Killed at random instants, every sample told of is there, none comes twice, the end is as if nobody had."""
    trial = kill_trial(tmp_path, samples, kills, seed=1)
    assert trial.kills > 0
    assert (trial.lost, trial.twice, trial.is_equal) == (0, 0, True)
