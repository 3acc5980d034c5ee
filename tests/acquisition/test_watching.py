"""What people are shown of a capture."""

from __future__ import annotations

import numpy as np

from basecal.acquisition.capture import Step
from basecal.acquisition.coverage import COVERAGE_GRID, Coverage
from basecal.acquisition.watching import End, Watch


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
    assert glance.said[-2:] == ("sample 2: not taken: target not seen by wrist", "sample 3: taken")
    assert glance.step.sample == 3


def test_a_glance_does_not_change():
    """Who looked sees what was, while the capture goes on."""
    watch = Watch()
    watch.notify("one")
    before = watch.snapshot
    watch.notify("two")
    watch.end(End("GOOD", "over"))
    assert (before.doing, before.end) == ("one", None)
    assert (watch.snapshot.doing, watch.snapshot.end.word) == ("two", "GOOD")


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
