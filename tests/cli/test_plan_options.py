"""Tests of the options that determine the plan of a capture."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest

from basecal.cli.capture_plan import capture_plan
from basecal.cli.plan_options import PlanOptions, store_plan_options
from basecal.errors import DatasetError, UsageError

POINT, OTHER = (0.8, 0.0, 1.0), (0.9, 0.0, 1.0)


@pytest.mark.parametrize(("earlier", "given", "problem"), [
    (PlanOptions("shifts", seed=3), PlanOptions(), ""),
    (PlanOptions("shifts", seed=3), PlanOptions("shifts", seed=3, samples=25), ""),
    (PlanOptions("shifts", seed=3), PlanOptions("poses"),
     "--pattern poses is of another plan than the interrupted one, with 1 sample left"),
    (PlanOptions(), PlanOptions("poses", seed=0), ""),
    (PlanOptions(), PlanOptions(seed=4), "made with the default options. Leave --seed out to continue it, or remove "),
    (PlanOptions(task_point=POINT), PlanOptions(task_point=POINT), ""),
    (PlanOptions(task_point=POINT), PlanOptions(task_point=OTHER), "was made with --task-point 0.8 0.0 1.0. Leave"),
    (PlanOptions(plan=Path("a.jsonl")), PlanOptions("poses"), "was made with --plan a.jsonl. Leave --pattern out"),
])  # fmt: skip
def test_options_of_another_plan_are_refused(
    earlier: PlanOptions, given: PlanOptions, problem: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The same options continue an interrupted plan, and so do none; others would have no effect."""
    monkeypatch.setattr("basecal.acquisition.capture.remaining_samples", lambda *_: ["left"])
    sketch = SimpleNamespace(cell=None)
    store_plan_options(tmp_path, earlier)
    made = partial(capture_plan, None, sketch, tmp_path, given)  # type: ignore[arg-type]
    if not problem:
        assert made() == (["left"], False)
        return
    with pytest.raises(UsageError, match=re.escape(problem)):
        made()


def test_stored_options_that_are_damaged_are_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Without the file, the interrupted plan goes on."""
    monkeypatch.setattr("basecal.acquisition.capture.remaining_samples", lambda *_: ["left"])
    sketch = SimpleNamespace(cell=None)
    made = partial(capture_plan, None, sketch, tmp_path, PlanOptions(seed=4))  # type: ignore[arg-type]
    assert made() == (["left"], False)
    (tmp_path / "recording").mkdir()
    for content in ("[", "[" * 99999, "[1]", b"\xff"):
        path = tmp_path / "recording" / "plan_options.json"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        with pytest.raises(DatasetError, match=r"plan_options\.json: expected a JSON object .*; remove the file"):
            made()
