"""Samples that name points which a target does not have."""

from __future__ import annotations

from basecal.cell.journal.observation_line import UnknownPoint
from basecal.cell.journal.sample_line import Dropped
from basecal.cell.journal.unknown_points import unknown_points

KNOWN = frozenset(range(24))


def dropped(sample: int, ids: set[int], target: str = "board") -> Dropped:
    return Dropped(sample, sample + 1, UnknownPoint(f"id {max(ids)} is not on it", target, frozenset(ids), KNOWN))


def test_one_is_told_with_its_line() -> None:
    """Which sample, where it stands and why."""
    (found,) = unknown_points([dropped(7, {3, 24})], "s.jsonl")
    assert (found.code, found.severity, found.about) == ("dropped-sample", "info", ("7",))
    assert found.message == "s.jsonl:8: sample 7 is dropped: id 24 is not on it."


def test_many_are_one_finding_for_each_target() -> None:
    """All numbers are what it is about, the first is told."""
    found = unknown_points([dropped(1, {30}), dropped(2, {31}), dropped(4, {40}, "tag")], "s.jsonl")
    assert [each.about for each in found] == [("1", "2"), ("4",)]
    assert "sample 1 and 1 more are dropped" in found[0].message
    assert "subtract" not in found[0].message


def test_ids_that_count_from_one_are_told_so() -> None:
    """Where they are those of the target, each by one larger."""
    (found,) = unknown_points([dropped(1, {1, 5, 24}), dropped(2, {2, 24})], "s.jsonl")
    assert found.message.endswith("Subtract 1 from each id: they count from 0.")
    (other,) = unknown_points([dropped(1, {2, 24})], "s.jsonl")
    assert "subtract" not in other.message
