"""Tests of the state of a capture that is shown to users."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.acquisition.capture import Step
from basecal.acquisition.coverage import COVERAGE_GRID, Coverage
from basecal.acquisition.running.check import Doubt
from basecal.acquisition.watching import End, Sigma, Watch


def step(number, why_not="", sigma=(1e-3, 2e-3)):
    return Step(
        number, why_not, number + 1, 9, Coverage(np.zeros(COVERAGE_GRID, dtype=bool), {"eye": np.zeros(3)}), sigma
    )


def test_results_of_samples_are_kept():
    """The last lines are kept, and a sigma for each sample once all directions are observable."""
    watch = Watch()
    for each in (step(0, sigma=None), step(1), step(2, "target not seen by wrist"), step(3)):
        watch.note(each)
    glance = watch.snapshot
    assert [sigma.samples for sigma in glance.sigmas] == [2, 4]
    assert glance.lines[-2:] == ("sample 2: not taken: target not seen by wrist", "sample 3: taken")
    assert glance.step.sample == 3


def test_snapshot_does_not_change():
    """A snapshot stays as it was while the capture continues."""
    watch = Watch()
    watch.notify("one")
    before = watch.snapshot
    watch.notify("two")
    watch.end(End("GOOD", "over"))
    assert (before.activity, before.end) == ("one", None)
    assert (watch.snapshot.activity, watch.snapshot.end.word) == ("two", "GOOD")


def test_remaining_time_uses_the_last_samples():
    """Each remaining sample takes the median of the last ones; no time is given before there are two."""
    clock = iter([0.0, 10.0, 20.0, 95.0])
    watch = Watch(lambda: next(clock))
    left = []
    for number in range(4):
        watch.note(step(number))
        left.append(watch.snapshot.time_left_s)
    assert left == [None, 70.0, 60.0, 50.0]


def test_errors_at_the_task_are_kept_by_the_number_of_samples():
    """They are kept with the tolerance; an unknown error is not added."""
    watch = Watch()
    watch.note_error(3e-4, None)
    watch.note(step(3))
    watch.note_error(3e-4, 5e-4)
    assert (watch.snapshot.tolerance_m, watch.snapshot.errors) == (3e-4, ((4, 5e-4),))


def test_advice_comes_from_the_coverage():
    """It is given once there are enough samples; none before the first."""
    watch = Watch()
    assert watch.snapshot.advice == ""
    watch.note(step(6))
    assert watch.snapshot.advice == "rotate eye further about x"


def test_last_eight_lines_are_shown():
    """Lines are samples, their doubts and messages; failures and persistent doubts are all kept."""
    watch = Watch()
    doubt, passing = Doubt(0, "eye moved", True), Doubt(0, "blurred", False)
    watch.note(replace(step(0, "no target"), doubts=(doubt, passing)))
    assert watch.snapshot.lines == ("sample 0: not taken: no target", "eye moved", "blurred")
    for number in range(1, 9):
        watch.report(f"line {number}")
    assert watch.snapshot.lines == tuple(f"line {number}" for number in range(1, 9))
    watch.note(step(1))
    assert watch.snapshot.lines == (*(f"line {number}" for number in range(2, 9)), "sample 1: taken")
    assert (watch.snapshot.failures, watch.snapshot.doubts) == (((0, "no target"),), ("eye moved",))


def test_given_up_sample_has_no_sigma():
    """Nor has a sample of unknown sigma; the others have both, by the number of samples."""
    watch = Watch()
    for each in (step(0, "why"), step(1, sigma=None), step(2, sigma=(3e-3, 4e-3))):
        watch.note(each)
    assert watch.snapshot.sigmas == (Sigma(3, 3e-3, 4e-3),)


def test_late_sigma_belongs_to_the_checked_samples():
    """Samples whose check has not ended do not count; a sigma of the same samples is kept once."""
    watch = Watch()
    for number, unchecked in ((4, 3), (5, 4), (6, 1)):
        watch.note(replace(step(number), unchecked=unchecked))
    assert [sigma.samples for sigma in watch.snapshot.sigmas] == [2, 6]


def test_latest_images_states_and_goals_are_kept():
    """Images are kept by camera, states and goals by robot, in the order of their first arrival."""
    watch = Watch()
    for camera, grey in (("a", 1), ("b", 2), ("a", 3)):
        watch.note_image(camera, grey)
    watch.note_state("eye", "here")
    watch.note_goal("eye", "there")
    found = watch.snapshot
    assert (found.images, found.states, found.goals) == ((("a", 3), ("b", 2)), (("eye", "here"),), (("eye", "there"),))


def test_first_end_of_a_capture_is_kept():
    """Later ends are ignored."""
    watch = Watch()
    watch.end(End("GOOD", "over"))
    watch.end(End("BAD", "late"))
    assert watch.snapshot.end.word == "GOOD"


@pytest.mark.parametrize(("taken", "left_s"), [(8, 10.0), (9, 0.0), (11, 0.0)])
def test_remaining_time_is_zero_after_the_last_sample(taken, left_s):
    """So it is if more were taken than planned; the median is of the last six instants."""
    clock = iter([0.0, 500.0, 600.0, 610.0, 620.0, 630.0, 640.0, 740.0])
    watch = Watch(lambda: next(clock))
    for _ in range(8):
        watch.note(replace(step(1), taken=taken))
    assert watch.snapshot.time_left_s == left_s


def test_errors_before_the_first_sample_have_count_zero():
    """Errors of several sample counts follow one another."""
    watch = Watch()
    watch.note_error(3e-4, 9e-4)
    watch.note(step(0))
    watch.note_error(3e-4, 5e-4)
    assert watch.snapshot.errors == ((0, 9e-4), (1, 5e-4))
