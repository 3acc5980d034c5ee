"""Tests of the reference of answers: it lists every difference."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest
from benchmarks.reference.__main__ import reason, report
from benchmarks.reference.answers import Answer, differences

NAME = "eye_base_from_hand_base"
POSE = [*np.eye(4)[:3].ravel(), *(1e-8 * np.eye(6))[np.triu_indices(6)]]
ANSWER: Answer = {"verdict": "good", "findings": ["info drift hand"], "transforms": {NAME: POSE}}


def changed(**fields: object) -> list[str]:
    return list(differences(ANSWER, {**deepcopy(ANSWER), **fields}))


def moved(index: int, by: float) -> dict[str, list[float]]:
    """Copy of the transform with one number changed."""
    return {NAME: [value + by * (k == index) for k, value in enumerate(POSE)]}


@pytest.mark.parametrize(("fields", "line"), [
    ({"verdict": "doubtful"}, "verdict good -> doubtful"),
    ({"findings": []}, "finding gone: info drift hand"),
    ({"findings": ["info drift hand", "warning sag eye"]}, "finding new: warning sag eye"),
    ({"transforms": {}}, f"{NAME} gone"),
    ({"transforms": moved(3, 1e-4)}, f"{NAME} moved by 1 sigma, 0.1 mm"),
    ({"transforms": moved(12, 3e-8)}, f"{NAME} sigma times 1 to 2"),
])  # fmt: skip
def test_each_difference_is_printed_as_a_line(fields: dict[str, object], line: str) -> None:
    """Differences of the verdict, a finding, a transform and a sigma are lines."""
    assert changed(**fields) == [line]


def test_rounding_is_not_listed() -> None:
    """A change below a thousandth of a sigma is not listed."""
    assert changed() == changed(transforms=moved(3, 5e-8)) == changed(transforms=moved(12, 1e-11)) == []


def test_explained_differences_are_counted_separately(capsys: pytest.CaptureFixture[str]) -> None:
    """An explained difference is printed with its reason; a case that is not stored is a difference."""
    found = {"cell 1": {**ANSWER, "verdict": "doubtful"}, "cell 2": ANSWER, "cell 3": ANSWER}
    explained = [{"lines": "^cell 1: verdict", "because": "it was wrong"}]
    assert report(found, {"cell 1": ANSWER, "cell 2": ANSWER}, explained) == 1
    printed = capsys.readouterr().out
    assert "cell 1: verdict good -> doubtful  [it was wrong]" in printed
    assert "cell 3: not in the reference" in printed
    assert "3 cases, 1 equal, 2 differences, 1 of them explained" in printed
    assert reason(explained, "cell 2: verdict") == ""
