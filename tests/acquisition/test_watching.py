"""What people are shown of a capture."""

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


def test_what_became_of_samples_is_kept():
    """The last lines, and a sigma for each sample that was taken once all directions are seen."""
    watch = Watch()
    for each in (step(0, sigma=None), step(1), step(2, "target not seen by wrist"), step(3)):
        watch.note(each)
    glance = watch.snapshot
    assert [sigma.samples for sigma in glance.sigmas] == [2, 4]
    assert glance.lines[-2:] == ("sample 2: not taken: target not seen by wrist", "sample 3: taken")
    assert glance.step.sample == 3


def test_a_glance_does_not_change():
    """Who looked sees what was, while the capture goes on."""
    watch = Watch()
    watch.notify("one")
    before = watch.snapshot
    watch.notify("two")
    watch.end(End("GOOD", "over"))
    assert (before.activity, before.end) == ("one", None)
    assert (watch.snapshot.activity, watch.snapshot.end.word) == ("two", "GOOD")


def test_the_time_left_is_that_of_the_last_samples():
    """What is left, each as long as the median of the last ones; nothing is said before there are two."""
    clock = iter([0.0, 10.0, 20.0, 95.0])
    watch = Watch(lambda: next(clock))
    left = []
    for number in range(4):
        watch.note(step(number))
        left.append(watch.snapshot.time_left_s)
    assert left == [None, 70.0, 60.0, 50.0]


def test_errors_at_the_task_are_kept_by_the_number_of_samples():
    """With the tolerance; nothing is added where nothing is known."""
    watch = Watch()
    watch.note_error(3e-4, None)
    watch.note(step(3))
    watch.note_error(3e-4, 5e-4)
    assert (watch.snapshot.tolerance_m, watch.snapshot.errors) == (3e-4, ((4, 5e-4),))


def test_advice_is_that_of_the_coverage():
    """Once there are enough samples; none before the first."""
    watch = Watch()
    assert watch.snapshot.advice == ""
    watch.note(step(6))
    assert watch.snapshot.advice == "turn eye further about x"


def test_the_last_eight_lines_are_shown():
    """Of samples, of doubts about them and of messages; failures and lasting doubts are all kept."""
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


def test_a_sample_that_was_not_taken_has_no_sigma():
    """Nor has one whose sigma is unknown; the others have both, by the number taken."""
    watch = Watch()
    for each in (step(0, "why"), step(1, sigma=None), step(2, sigma=(3e-3, 4e-3))):
        watch.note(each)
    assert watch.snapshot.sigmas == (Sigma(3, 3e-3, 4e-3),)


def test_the_last_of_each_is_kept():
    """Images by camera, states and goals by robot, in the order in which they first came."""
    watch = Watch()
    for camera, grey in (("a", 1), ("b", 2), ("a", 3)):
        watch.note_image(camera, grey)
    watch.note_state("eye", "here")
    watch.note_goal("eye", "there")
    found = watch.snapshot
    assert (found.images, found.states, found.goals) == ((("a", 3), ("b", 2)), (("eye", "here"),), (("eye", "there"),))


def test_a_capture_ends_once():
    """The first end stays."""
    watch = Watch()
    watch.end(End("GOOD", "over"))
    watch.end(End("BAD", "late"))
    assert watch.snapshot.end.word == "GOOD"


@pytest.mark.parametrize(("taken", "left_s"), [(8, 10.0), (9, 0.0), (11, 0.0)])
def test_no_time_is_left_after_the_last_sample(taken, left_s):
    """Also if more were taken than planned; the median is of the last six instants."""
    clock = iter([0.0, 500.0, 600.0, 610.0, 620.0, 630.0, 640.0, 740.0])
    watch = Watch(lambda: next(clock))
    for _ in range(8):
        watch.note(replace(step(1), taken=taken))
    assert watch.snapshot.time_left_s == left_s


def test_errors_before_the_first_sample_are_those_of_none():
    """Errors of several numbers of samples follow one another."""
    watch = Watch()
    watch.note_error(3e-4, 9e-4)
    watch.note(step(0))
    watch.note_error(3e-4, 5e-4)
    assert watch.snapshot.errors == ((0, 9e-4), (1, 5e-4))
