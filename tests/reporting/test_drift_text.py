"""Verifications and comparisons in words and as JSON."""

import json
from dataclasses import replace

import numpy as np

from basecal.accuracy.compare import Comparison, Difference
from basecal.accuracy.drift.shifts import Shift
from basecal.accuracy.drift.verify import Verification
from basecal.reporting.drift_text import comparison_dict, comparison_text, verification_dict, verification_text

BASE = Shift(
    "hand_base",
    "eye_base_from_hand_base",
    None,
    np.array([3e-3, 4e-3, 0, 0, 0, np.radians(0.5)]),
    np.diag([1e-4, 0, 0, 0, 0, np.radians(0.1)]) ** 2,
    np.eye(6),
    50.0,
    6,
)
JOINT = replace(
    BASE, frame="hand_flange", transform="", joint=2, size=np.array([np.radians(0.2)]), covariance=np.eye(1)
)
MOVED = Verification(True, 1e-7, BASE, (JOINT,), 4e-4, (40, 41))


def test_what_moved_is_named_with_its_size() -> None:
    text = verification_text(MOVED)
    assert text.startswith("MOVED: 2 samples are not explained (p = 1e-07)")
    assert "most likely hand_base, by 5.000 ± 0.060 mm and 0.50 ± 0.10 deg" in text
    assert "as likely, or nearly: joint 3 of hand;" in text
    assert "a shift of 0.40 mm would be seen with 95% chance" in text


def test_as_json() -> None:
    data = json.loads(json.dumps(verification_dict(MOVED), allow_nan=False))
    assert data["moved"] is True
    assert (data["frame"], data["transform"], data["joint"]) == ("hand_base", "eye_base_from_hand_base", None)
    assert round(data["shift_mm"], 9) == 5.0
    assert round(data["detectable_mm"], 9) == 0.4
    assert data["p"] == 1e-7
    assert verification_dict(replace(MOVED, shift=JOINT))["joint"] == 3


def test_nothing_moved_names_nothing() -> None:
    still = replace(MOVED, moved=False, chance=0.4, alternatives=(), outliers=(41,))
    data = verification_dict(still)
    assert (data["frame"], data["shift_mm"]) == (None, None)
    text = verification_text(still)
    assert text.splitlines()[0] == "NOT MOVED: 2 samples agree with the calibration"
    assert "sample 41 disagrees with the others and was left out" in text


def test_what_cannot_be_told_says_what_to_do() -> None:
    blind = Verification(None, 1.0, None, (), None, ())
    assert verification_text(blind).startswith("UNDECIDED: these samples do not show whether anything moved. Take more")
    assert verification_dict(blind)["moved"] is None
    assert verification_dict(blind)["detectable_mm"] is None


def test_comparisons() -> None:
    differing = {"a_from_b": Difference(2e-3, np.radians(0.1), 4.5, 1e-6), "b_from_c": Difference(0.0, 0.0, None, None)}
    found = Comparison(differing, {"c_from_d": 1}, ("cell.yaml",), {"start": ("closed", "guess")}, False)
    data = json.loads(json.dumps(comparison_dict(["one", "two"], [found]), allow_nan=False))
    assert data["agree"] is False
    assert data["runs"] == ["one", "two"]
    assert data["differences"][0]["transforms"]["a_from_b"]["shift_mm"] == 2.0
    assert data["differences"][0]["only"] == {"c_from_d": "two"}
    text = comparison_text(["one", "two"], [found])
    assert text.splitlines() == [
        "DISAGREE",
        "two against one",
        "  a_from_b  2.0 mm and 0.10 deg  4.5 sigma (p = 1e-06)",
        "  b_from_c  0 mm and 0 deg",
        "  c_from_d is only in two",
        "  other cell.yaml",
        "  start: closed there, guess here",
    ]
    alike = replace(found, agree=True)
    assert comparison_dict(["one", "two", "three"], [alike, found])["agree"] is False
    assert comparison_text(["one", "two"], [replace(found, agree=None)]).startswith("UNDECIDED")
