"""What is asked of the solver."""

from __future__ import annotations

from basecal.estimation.settings import DEFAULT, Settings
from basecal.estimation.stages import Stages


def test_settings_as_plain_values():
    """All but where time is counted, which is no part of what is asked and makes no difference."""
    assert DEFAULT.as_dict() == {
        "method": "maximum-likelihood",
        "iterations": 100,
        "start": "closed",
        "task_point": None,
        "station_choice": "nearest",
        "robot_noise": None,
        "certify": False,
    }
    assert Settings(stages=Stages()) == DEFAULT


def test_work_is_done_whether_its_time_is_counted_or_not():
    """A stage without a place to count it is nothing."""
    done = []
    for settings in (DEFAULT, Settings(stages=Stages())):
        with settings.stage("work"):
            done.append(settings)
    assert len(done) == 2
