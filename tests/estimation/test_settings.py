"""Tests of the solver's settings."""

from __future__ import annotations

import logging
import subprocess
import sys

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.estimation.settings import DEFAULT, Settings
from basecal.estimation.stages import Stages


def test_settings_as_dict():
    """All settings but the timer are included, because the timer has no effect on the result."""
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


def test_stages_run_with_or_without_a_timer():
    """The work of a stage is done whether or not its time is measured."""
    done = []
    for settings in (DEFAULT, Settings(stages=Stages())):
        with settings.stage("work"):
            done.append(settings)
    assert len(done) == 2


def test_stages_are_logged_and_not_printed(caplog):
    """Stages are logged by the standard module, as `basecal`. Without a handler there is no output."""
    with caplog.at_level(logging.INFO, logger="basecal"), DEFAULT.stage("work"):
        pass
    assert [record.getMessage() for record in caplog.records] == ["stage: work"]
    quiet = "import logging, basecal\nbasecal.Settings()\nlogging.getLogger('basecal').error('x')"
    result = subprocess.run([sys.executable, "-c", quiet], capture_output=True, text=True, check=True)
    assert (result.stdout, result.stderr) == ("", "")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"method": "max-likelihood"},
            r"^method is .*'maximum-likelihood'\?\), expected one of: .*scene$",
        ),
        ({"start": "carefully"}, "^start is 'carefully', expected one of: closed, thorough, guess, axis-shift$"),
        ({"robot_noise": "state"}, "^robot_noise is 'state'.*, expected one of: stated, estimated$"),
        ({"against": "cv2"}, "^against is 'cv2'.*, expected one of: opencv$"),
        ({"station_choice": "x"}, "^station_choice is 'x', expected one of: nearest, weighted$"),
        ({"iterations": 0}, "^iterations is 0, expected a whole number >= 1$"),
        ({"iterations": "x"}, "^iterations is 'x', expected a whole number >= 1$"),
        ({"iterations": True}, "^iterations is True, expected a whole number >= 1$"),
        ({"certify": "no"}, "^certify is of type str, expected bool$"),
        ({"stages": 3}, "^stages is of type int, expected Stages$"),
        ({"task_point": (float("nan"), 0, 0)}, r"^task_point is \(nan, 0, 0\), expected 3 finite numbers \[m\]$"),
        ({"task_point": (1, 2)}, "expected 3 finite numbers"),
        ({"task_point": "abc"}, "^task_point is 'abc', expected 3 finite numbers"),
        ({"task_point": 1.0}, "^task_point is 1.0, expected 3 finite numbers"),
        ({"task_box": (0, 0, 0, 1, 1, 1)}, "^task_box needs a task_point"),
        ({"task_point": (0, 0, 0), "task_box": (0, 0, 0, 1, 1)}, "expected 6 finite numbers"),
        ({"task_point": (0, 0, 0), "task_box": (0, 0, 0, 1, 1, 0)}, "^task_box is .* that differ in x, in y and in z$"),
    ],
)
def test_invalid_settings_are_refused(values, message):
    """The error has the name, the value and the choices, for settings from Python or from a file."""
    for make in (lambda: Settings(**values), lambda: Settings.from_dict(values)):
        with pytest.raises(InputError, match=message):
            make()


def test_points_of_any_sequence_become_tuples():
    """A list, as in a file, and an array equal a tuple."""
    tuple_of = Settings(task_point=(1.0, 2.0, 3.0))
    assert Settings.from_dict({"task_point": [1, 2, 3], "of_another": 1}) == tuple_of
    assert Settings(task_point=np.array([1.0, 2.0, 3.0])) == tuple_of
