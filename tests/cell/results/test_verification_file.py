"""Tests of the stored results of verifications."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from basecal.cell import MeasuredShift, PastVerification
from basecal.cell.files import append_verification, read_verifications
from basecal.errors import DatasetError

SHIFT = MeasuredShift(np.array([1e-3, 0.0, -2e-3]), np.full(3, 5e-4))


def entry(day: int, moved: bool | None = False) -> PastVerification:
    """Return a verification on this day of January."""
    when = datetime(2026, 1, day, 6, tzinfo=UTC)
    return PastVerification(when, "20260101T000000Z", 4, moved, 0.25, 6e-4, None, {"a_from_b": SHIFT})


def test_verifications_are_read_in_order(tmp_path: Path) -> None:
    """All appended verifications are read back in order; a missing file is an empty history."""
    assert read_verifications(tmp_path) == ()
    append_verification(tmp_path, entry(2))
    append_verification(tmp_path, entry(9, None))
    first, second = read_verifications(tmp_path)
    assert (first.when, first.run, first.samples, first.moved, first.chance, first.detectable_m, first.frame) == (
        entry(2).when, "20260101T000000Z", 4, False, 0.25, 6e-4, None,
    )  # fmt: skip
    assert second.moved is None
    np.testing.assert_array_equal(first.shifts["a_from_b"].t_m, SHIFT.t_m)
    np.testing.assert_array_equal(first.shifts["a_from_b"].sigma_m, SHIFT.sigma_m)


def test_truncated_line_is_ignored(tmp_path: Path) -> None:
    """A truncated last line is left out."""
    append_verification(tmp_path, entry(2))
    with (tmp_path / "verifications.jsonl").open("a") as file:
        file.write('{"when": "2026-01-0')
    assert len(read_verifications(tmp_path)) == 1


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [("0.25", "NaN", "line"), ('"p"', '"q"', "p"), ("[0.0005,", "[-0.0005,", "sigma_m"), ("false", '"no"', "moved")],
)
def test_invalid_verification_is_refused(tmp_path: Path, old: str, new: str, field: str) -> None:
    """The error names the file, line and field."""
    append_verification(tmp_path, entry(2))
    append_verification(tmp_path, entry(3))
    path = tmp_path / "verifications.jsonl"
    first, second = path.read_text().splitlines()
    path.write_text(f"{first}\n{second.replace(old, new)}\n")
    with pytest.raises(DatasetError, match=rf"verifications\.jsonl:2: .*{field}"):
        read_verifications(tmp_path)


def test_times_without_zone_are_utc(tmp_path: Path) -> None:
    """A time without a time zone is UTC, and empty lines are ignored."""
    append_verification(tmp_path, entry(2))
    path = tmp_path / "verifications.jsonl"
    text = path.read_text()
    assert "2026-01-02T06:00:00+00:00" in text or "2026-01-02T06:00:00Z" in text
    naive = text.replace("+00:00", "").replace("06:00:00Z", "06:00:00")
    elsewhere = text.replace("+00:00", "+02:00").replace("06:00:00Z", "06:00:00+02:00")
    path.write_text(f"{naive}\n  \n{elsewhere}")
    first, second = read_verifications(tmp_path)
    assert first.when == datetime(2026, 1, 2, 6, tzinfo=UTC)
    assert second.when == datetime(2026, 1, 2, 4, tzinfo=UTC)
