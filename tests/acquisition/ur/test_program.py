"""The program of ur-rtde on a controller in a process of its own."""

from __future__ import annotations

import time

import pytest

from basecal.acquisition.ur.options import UrOptions
from basecal.acquisition.ur.program import Program
from basecal.errors import DriverError

pytest.importorskip("rtde_control")


def program(place):
    """The program of a controller."""
    return Program("eye", UrOptions(**place().options))


def test_it_is_sent_when_it_is_first_asked_and_ends_with_the_capture(there):
    """Before it is asked nothing of it is on the controller; closed, it has been told to stop."""
    process, place = there
    asked = program(place)
    assert not asked.was_asked
    assert process.tell("tell").split()[2:] == []
    assert asked.ask(lambda line: line.isJointsWithinSafetyLimits([0.0] * 6))
    assert asked.was_asked
    asked.close()
    assert process.tell("tell").split()[2:] == ["37", "255"]


def test_it_is_sent_again_where_it_was_stopped(there):
    """A person who stops it at the pendant stops one move; the next one brings it again."""
    process, place = there
    asked = program(place)
    assert asked.ask(lambda line: line.isJointsWithinSafetyLimits([0.0] * 6))
    process.tell("stop_program")
    time.sleep(0.1)
    assert asked.ask(lambda line: line.isProgramRunning())
    asked.close()


def test_no_permission_to_move(there):
    """A controller in local mode takes no program: it says what to choose on the pendant."""
    process, place = there
    process.tell("local")
    with pytest.raises(DriverError, match="eye: no permission to move: choose remote control"):
        program(place).ask(lambda line: line.isProgramRunning())
