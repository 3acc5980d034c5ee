"""Tests of generators that run in step."""

from __future__ import annotations

from basecal.numerics.steps import run_in_step


def test_requests_of_generators_are_batched():
    """Each generator receives its own answers, also after others have ended. Results keep the order of the tasks."""
    batches = []

    def square_all(wanted):
        batches.append(wanted)
        return (number**2 for number in wanted)

    def task(count):
        total = 0
        for number in range(count):
            total += yield 10 * count + number
        return total

    assert run_in_step([task(2), task(0), task(3)], square_all) == [20**2 + 21**2, 0, 30**2 + 31**2 + 32**2]
    assert batches == [[20, 30], [21, 31], [32]]
    assert run_in_step([], square_all) == []
