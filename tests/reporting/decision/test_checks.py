"""What was checked, in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from basecal.cell import Calibration, Finding
from basecal.geometry import SE3, PoseEstimate
from basecal.reporting.decision.checks import check_words, passed_checks

DOCUMENT = Path(__file__).parents[3] / "docs" / "findings.md"


def test_every_check_has_words_and_a_place_in_the_document() -> None:
    """By the code of its finding."""
    words, text = check_words(), DOCUMENT.read_text(encoding="utf-8")
    assert len(words) > 20
    assert all(f"`{code}`" in text for code in words)
    assert words["overfit"].startswith("held-out samples")


def test_what_found_something_has_not_passed() -> None:
    """Nothing has where nothing was calibrated."""
    made = Calibration("good", {"a_base_from_b_base": PoseEstimate(SE3.identity(), np.eye(6))})
    doubted = Calibration("doubtful", made.transforms, findings=(Finding("overfit", "warning", (), "x"),))
    assert {code for code, _ in passed_checks(made)} - {code for code, _ in passed_checks(doubted)} == {"overfit"}
    assert list(passed_checks(Calibration("refused"))) == []
