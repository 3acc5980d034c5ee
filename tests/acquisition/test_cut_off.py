"""Tests of killed captures."""

from __future__ import annotations

import pytest

from shared.kill_trial import kill_trial


@pytest.mark.slow  # that each sample is written when it is told is tried without kills by test_capture
@pytest.mark.parametrize(("samples", "kills"), [(2, 2), (12, 40)])
def test_killed_capture_loses_no_reported_sample(tmp_path, samples, kills):
    """After kills at random instants each reported sample exists exactly once.

    The final recording equals that of an undisturbed capture.
    """
    trial = kill_trial(tmp_path, samples, kills, seed=1)
    assert trial.kills > 0
    assert (trial.lost, trial.twice, trial.is_equal) == (0, 0, True)
