"""How long a calibration takes still."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from basecal.accuracy.calibrate import JUDGING_STAGES, READING_STAGES, SOLVING_STAGES
from basecal.cli.time_left import _SHARES, TimeLeft


class Clock:
    """Seconds that pass when they are told to."""

    time_s = 100.0

    def __call__(self) -> float:
        return self.time_s


@pytest.fixture
def clock() -> Iterator[Clock]:
    return Clock()


def test_it_names_what_is_done(clock: Clock) -> None:
    """From the first stage on; of the time nothing is said before anything is known."""
    left = TimeLeft("calibrating", clock)
    assert str(left) == "calibrating"
    left.enter("noise")
    clock.time_s += 0.4
    assert str(left) == "calibrating: noise"
    assert left.seconds() is None


def test_it_counts_down(clock: Clock) -> None:
    """What is left is as the share of the stages that are to come, less what has passed of the present one."""
    left = TimeLeft("calibrating", clock)
    left.enter("noise")
    clock.time_s += 32.0
    left.enter("conventions")
    assert left.seconds() == pytest.approx(103.0)
    clock.time_s += 8.0
    assert str(left) == "calibrating: conventions, about 95 s left"
    clock.time_s += 1000.0
    assert str(left) == "calibrating: conventions"


def test_a_stage_that_comes_again_counts_once(clock: Clock) -> None:
    """And one that is not known counts as nothing."""
    left = TimeLeft("calibrating", clock)
    for stage in ("noise", "conventions", "noise", "new"):
        left.enter(stage)
        clock.time_s += 9.0
    left.enter("cross-validation")
    assert left.seconds() == pytest.approx(36.0 * 63 / 72)


def test_parts_of_a_stage_are_shown(clock: Clock) -> None:
    """How much of it is done, while its time counts from its beginning."""
    left = TimeLeft("calibrating", clock)
    left.enter("noise")
    clock.time_s += 32.0
    left.enter("conventions")
    clock.time_s += 4.0
    left.enter("conventions, 3 of 9")
    clock.time_s += 4.0
    assert str(left) == "calibrating: conventions, 3 of 9, about 95 s left"


def test_stages_of_calibrate_have_shares():
    """Each that every calibration has; those of streams and of a task are not counted."""
    named = {stage.name for stage in (*READING_STAGES, *SOLVING_STAGES, *JUDGING_STAGES)} - {None}
    assert named - _SHARES.keys() == {"clocks", "task"}
