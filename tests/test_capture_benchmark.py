"""What the benchmark of captures counts, and what it keeps."""

from __future__ import annotations

from pathlib import Path

from benchmarks.capture import HEAD, Kept, Outcome, row, size_of


def outcome(verdict: str, nees: float | None, *findings: str) -> Outcome:
    return Outcome(verdict, nees, 0.1, list(findings), 0, 1.0)


def test_a_cell_is_safe_inside_the_ellipsoid_or_named_first() -> None:
    """Not where it is good and outside, nor where another finding comes first; one without an answer is not inside."""
    cells = [
        outcome("good", 5.0),
        outcome("doubtful", 90.0, "base-moved", "poor-fit"),
        outcome("doubtful", 90.0, "poor-fit", "base-moved"),
        outcome("good", 90.0),
        outcome("refused", None, "too-few-samples"),
    ]
    told = dict(zip(HEAD, row("base-bumped", "5 mm", cells), strict=True))
    assert (told["cells"], told["good"], told["in 99.7 %"], told["in 99.7 % or named first"]) == (5, 2, 1, 2)
    assert told["first finding"] == "base-moved 1, poor-fit 1, too-few-samples 1"


def test_outcomes_outlive_a_run(tmp_path: Path) -> None:
    """What was kept is there again, in the order of its seeds, and apart from other faults."""
    kept = Kept(tmp_path / "kept.jsonl")
    for seed in (0, 1, 10, 2):
        kept.keep(f"sag#{seed}", outcome("good", float(seed)))
    kept.keep("#0", outcome("good", 7.0))
    kept.keep("size:sag", {"size": 0.0123, "is_usual": False})
    again = Kept(tmp_path / "kept.jsonl")
    assert [each.nees for each in again.outcomes("sag")] == [0.0, 1.0, 2.0, 10.0]
    assert [each.nees for each in again.outcomes("")] == [7.0]
    assert size_of(again, "sag") == "0.0123 deg"
    assert (size_of(again, "backlash"), again.get("sag#3")) == ("", None)
