"""Tests of touches with hand-guided tips."""

from __future__ import annotations

import numpy as np
import pytest
from tests.touch_cells import touch_cell

from basecal.acquisition.driver import Reading
from basecal.acquisition.hand_guided_touches import take_touches
from basecal.acquisition.rig import Rig
from basecal.cell import RobotState
from basecal.cell.files import read_recording
from basecal.errors import InputError
from basecal.geometry import SE3

STEP_S = 0.1


class Arm:
    """Arm at rest, or with a drift per state [m]."""

    is_live = True

    def __init__(self, drift_m=0.0):
        self.drift_m, self.asked, self.freedrives = drift_m, 0, []

    def state(self):
        self.asked += 1
        place = SE3(np.eye(3), np.array([0.4 + self.drift_m * self.asked, 0.0, 0.5]))
        return Reading(STEP_S * self.asked, RobotState(place))

    def freedrive(self, on):
        self.freedrives.append(on)

    def close(self):
        pass


def taken(tmp_path, arms, *lines):
    """Samples for these typed lines, and the reported messages."""
    typed, told = iter([*(f"{line}\n" for line in lines), ""]), []
    (tmp_path / "recording").mkdir(exist_ok=True)
    found = list(take_touches(Rig(arms, {}), touch_cell(), tmp_path, lambda: next(typed), told.append))
    return found, told


def test_each_line_is_a_stored_touch(tmp_path):
    """An empty line repeats the mark; arms are free until the line is typed, and held during the touch."""
    arm = Arm()
    found, _ = taken(tmp_path, {"eye": arm}, "mark_a", "", "mark_b eye_tip", "q")
    assert [sample.observations[0].mark for sample in found] == ["mark_a", "mark_a", "mark_b"]
    assert arm.freedrives == [True, False] * 4
    written = read_recording(tmp_path, touch_cell()).samples
    assert [sample.sample for sample in written] == [0, 1, 2]
    more, _ = taken(tmp_path, {"eye": arm}, "mark_c")
    assert more[0].sample == 3


def test_refused_touches_are_reported(tmp_path):
    """Unknown marks, an ambiguous tip, and a moving arm are reported."""
    both = {"eye": Arm(), "hand": Arm()}
    found, told = taken(tmp_path, both, "mark_x eye_tip", "mark_a", "mark_a hand_tip")
    assert [sample.observations[0].tip for sample in found] == ["hand_tip"]
    assert [line.split(";")[0] for line in told if line.startswith("Not taken")] == [
        "Not taken: no mark 'mark_x' (did you mean 'mark_c'?)",
        "Not taken: no tip ''",
    ]
    found, told = taken(tmp_path, {"eye": Arm(1e-2)}, "mark_a")
    assert not found
    assert any("still moving: eye" in line for line in told)


def test_rig_without_tips_is_refused(tmp_path):
    """The rig lacks the robots of the tips."""
    with pytest.raises(InputError, match="need a tip"):
        taken(tmp_path, {})
