"""Tests of tasks for which a capture is planned again while it runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from basecal.cli import replanning as module
from basecal.cli.plan_options import PlanOptions
from basecal.cli.replanning import Replanner, Task, requested_task
from basecal.errors import UsageError


def test_task_is_a_place_and_a_tolerance() -> None:
    """A point is one place, a box nine; lengths are in metres."""
    assert requested_task((0.5, 0.0, 0.3), None, "0.3mm") == Task([(0.5, 0.0, 0.3)], pytest.approx(3e-4))
    box = requested_task(None, (0.0, 0.0, 0.0, 1.0, 1.0, 1.0), "1mm")
    assert box is not None
    assert len(box.points_m) == 9
    assert requested_task(None, None, None) is None


def test_task_without_place_or_tolerance_is_refused() -> None:
    """A place or a tolerance alone does not define the end of the capture."""
    for words in ((None, None, "1mm"), ((0.5, 0.0, 0.3), None, None), ((0.0,) * 3, (0.0,) * 6, "1mm")):
        with pytest.raises(UsageError):
            requested_task(*words)


Making = Callable[..., tuple[Replanner, list[tuple[object, ...]]]]


def plan(samples: int = 5, **more: object) -> SimpleNamespace:
    """Plan with a given number of remaining samples."""
    steps = [(0, 4e-4), (samples, 2e-4)]
    usual = {"reachable": True, "needed": samples, "place": "task point", "expected_m": 2.5e-4, "budget": ()}
    left = tuple(range(100, 100 + samples))
    return SimpleNamespace(**{**usual, "steps": steps, "samples": left, **more})


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> Making:
    """Replanner of two recorded samples with given plans, and the arguments of its calls."""

    def make(*plans: SimpleNamespace, most: int | None = None) -> tuple[Replanner, list[tuple[object, ...]]]:
        """Function that returns these plans in turn."""
        asked: list[tuple[object, ...]] = []
        given = iter(plans)

        def next_plan(samples: tuple[int, ...], bad: list[str]) -> SimpleNamespace:
            """Record the known samples, and return the next plan."""
            asked.append((samples, [*bad]))
            return next(given)

        monkeypatch.setattr(module, "detected_samples", lambda *_: (0, 1))
        monkeypatch.setattr("basecal.acquisition.capture.abandoned_samples", lambda *_: ["given up"])
        monkeypatch.setattr("basecal.acquisition.rig.starting_states", lambda *_: {})
        monkeypatch.setattr("basecal.acquisition.replanning.replanner", lambda *_: SimpleNamespace(plan=next_plan))
        sketch = SimpleNamespace(cell=None)
        task = Task([(0.5, 0.0, 0.3)], 3e-4)
        return Replanner(None, sketch, Path("c"), task, PlanOptions(samples=most)), asked  # type: ignore[arg-type]

    return make


def test_samples_are_planned_up_to_their_limit(made: Making) -> None:
    """Samples recorded before do not count; refused ones are excluded for good."""
    found, asked = made(plan(5), plan(5), plan(5), plan(5), most=3)
    assert found.samples == (100, 101, 102)
    assert found.exclude(["refused"]) == (100, 101, 102)  # type: ignore[list-item]
    assert found((0, 1, 2, 3), ["bad"]) == (100,)  # type: ignore[arg-type,list-item]
    assert found((0, 1, 2, 3, 4, 5, 6), []) == ()  # type: ignore[arg-type]
    assert asked == [
        ((0, 1), ["given up"]),
        ((0, 1), ["given up", "refused"]),
        ((0, 1, 2, 3), ["bad"]),
        ((0, 1, 2, 3, 4, 5, 6), []),
    ]


@pytest.mark.parametrize(("latest", "reached", "words"), [
    (plan(0), True, "is reached: 95 % of errors are expected below 0.25 mm"),
    (plan(0, expected_m=None), True, "is reached"),
    (plan(4), False, "needs 4 more samples"),
    (plan(4, reachable=False, budget=[SimpleNamespace(source="noise")]), False, "largest part of the error is noise"),
    (plan(0, reachable=False), False, "cannot be reached"),
])  # fmt: skip
def test_reached_tolerance_is_reported(made: Making, latest: SimpleNamespace, reached: bool, words: str) -> None:
    """The tolerance counts as reached if no sample remains and the last plan says so; as text and as data."""
    found, _ = made(latest)
    assert found.is_reached == reached
    assert found.words().startswith("0.3 mm ")
    assert found.words().endswith(words)
    predicted_mm = None if latest.expected_m is None else pytest.approx(0.25)
    assert found.as_dict() == {"reached": reached, "needed": latest.needed, "predicted_mm": predicted_mm}
    assert found.error_m == 4e-4


def test_error_is_known_if_the_plan_has_steps(made: Making) -> None:
    """Otherwise it is None."""
    assert made(plan(2, steps=[]))[0].error_m is None


def test_task_may_have_no_tolerance() -> None:
    """Then the number of samples ends the capture."""
    assert requested_task((0.5, 0.0, 0.3), None, None, may_be_open=True) == Task([(0.5, 0.0, 0.3)], None)
    with pytest.raises(UsageError, match=r"ends at a tolerance: give --tolerance, such as 0\.3mm"):
        requested_task((0.5, 0.0, 0.3), None, None)
