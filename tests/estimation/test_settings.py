"""What is asked of the solver."""

from __future__ import annotations

import logging
import subprocess
import sys

from basecal.estimation.settings import DEFAULT, Settings
from basecal.estimation.stages import Stages


def test_settings_as_plain_values():
    """All but where time is counted, which is no part of what is asked and makes no difference."""
    assert DEFAULT.as_dict() == {
        "method": "maximum-likelihood",
        "iterations": 100,
        "start": "closed",
        "task_point": None,
        "task_box": None,
        "station_choice": "nearest",
        "robot_noise": "estimated",
        "certify": False,
        "against": None,
        "joins_scene": False,
    }
    assert Settings(stages=Stages()) == DEFAULT


def test_work_is_done_whether_its_time_is_counted_or_not():
    """A stage without a place to count it is nothing."""
    done = []
    for settings in (DEFAULT, Settings(stages=Stages())):
        with settings.stage("work"):
            done.append(settings)
    assert len(done) == 2


def test_stages_are_logged_and_nothing_is_printed(caplog):
    """By the standard module, as `basecal`; who sets no handler sees nothing."""
    with caplog.at_level(logging.INFO, logger="basecal"), DEFAULT.stage("work"):
        pass
    assert [record.getMessage() for record in caplog.records] == ["stage: work"]
    quiet = "import logging, basecal\nbasecal.Settings()\nlogging.getLogger('basecal').error('x')"
    said = subprocess.run([sys.executable, "-c", quiet], capture_output=True, text=True, check=True)
    assert (said.stdout, said.stderr) == ("", "")
