"""Tests of verifications, comparisons and histories as text and as JSON."""

import json
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from basecal.accuracy.compare import Comparison, Difference
from basecal.accuracy.drift.history import Drift
from basecal.accuracy.drift.shifts import Shift
from basecal.accuracy.drift.verify import Verification
from basecal.cell import MeasuredShift, PastVerification
from basecal.reporting.drift_text import (
    comparison_dict,
    comparison_text,
    drift_sentence,
    history_dict,
    history_text,
    verification_dict,
    verification_text,
)

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


def test_verification_text_states_moved_frame_and_shift() -> None:
    """The text names the most likely frame with its shift and sigmas.

    It also has the alternatives and the smallest detectable shift.
    """
    text = verification_text(MOVED)
    assert text.startswith("MOVED: 2 samples are not explained (p = 1e-07)")
    assert "most likely hand_base, by 5.000 ± 0.060 mm and 0.50 ± 0.10 deg" in text
    assert "as likely, or nearly: joint 3 of hand;" in text
    assert "a shift of 0.40 mm would be detected with a probability of 95 %" in text


def test_verification_is_written_as_json() -> None:
    """The JSON of a verification has the verdict, the frame, its transform or joint, the shift in mm and p."""
    data = json.loads(json.dumps(verification_dict(MOVED), allow_nan=False))
    assert data["moved"] is True
    assert (data["frame"], data["transform"], data["joint"]) == ("hand_base", "eye_base_from_hand_base", None)
    assert round(data["shift_mm"], 9) == 5.0
    assert round(data["detectable_mm"], 9) == 0.4
    assert data["p"] == 1e-7
    assert verification_dict(replace(MOVED, shift=JOINT))["joint"] == 3


def test_unmoved_cell_has_no_frame_or_shift() -> None:
    """A verification without motion names no frame. It counts the samples that agree and lists outliers."""
    still = replace(MOVED, moved=False, chance=0.4, alternatives=(), outliers=(41,))
    data = verification_dict(still)
    assert (data["frame"], data["shift_mm"]) == (None, None)
    text = verification_text(still)
    assert text.splitlines()[0] == "NOT MOVED: 2 samples agree with the calibration"
    assert "sample 41 disagrees with the others and was left out" in text
    single = replace(still, samples=(40,))
    assert verification_text(single).splitlines()[0] == "NOT MOVED: 1 sample agrees with the calibration"
    assert verification_text(replace(MOVED, samples=(40,))).startswith("MOVED: 1 sample is not explained")
    assert "(p < 1e-300)" in verification_text(replace(MOVED, chance=0.0))


def test_undecided_verification_asks_for_more_samples() -> None:
    """A verification without a verdict is undecided, asks for more samples and has no detectable shift."""
    blind = Verification(None, 1.0, None, (), None, ())
    assert verification_text(blind).startswith("UNDECIDED: these samples do not show whether anything moved. Take more")
    assert verification_dict(blind)["moved"] is None
    assert verification_dict(blind)["detectable_mm"] is None


def test_comparison_is_written_as_text_and_json() -> None:
    """A comparison lists the differences of transforms, files and settings of runs, as text and as JSON.

    It disagrees if any pair of runs does.
    """
    differing = {"a_from_b": Difference(2e-3, np.radians(0.1), 4.5, 1e-6), "b_from_c": Difference(0.0, 0.0, None, None)}
    found = Comparison(
        differing,
        {"c_from_d": 1},
        ("cell.yaml",),
        {"start": ("closed", "guess"), "task_point": (None, [0.6, 0.2, 0.4])},
        False,
    )
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
        "  cell.yaml differs",
        "  start: closed in one, guess in two",
        "  task_point: not set in one, [0.6, 0.2, 0.4] in two",
    ]
    alike = replace(found, agree=True)
    assert comparison_dict(["one", "two", "three"], [alike, found])["agree"] is False
    assert comparison_text(["one", "two"], [replace(found, agree=None)]).startswith("UNDECIDED")


WHEN = datetime(2026, 3, 4, 5, 6, 7, tzinfo=UTC)
SHIFTS = {"a_from_b": MeasuredShift(np.array([3e-3, 0, 4e-3]), np.full(3, 1e-4))}
PAST = PastVerification(WHEN, "r1", 4, True, 1e-7, 4e-4, "hand_base", SHIFTS)
DRIFT = Drift("a_from_b", "r1", 5, np.array([3e-4, 0, 4e-4]), np.array([0, 6e-5, 8e-5]), 1e-5)


def test_shifted_joint_is_stated_in_degrees() -> None:
    """A single sample is written in the singular. The shift of a joint is its offset in degrees, with its sigma."""
    one = replace(
        MOVED, samples=(40,), alternatives=(), shift=replace(JOINT, covariance=np.radians(0.05) ** 2 * np.eye(1))
    )
    first, *others = verification_text(one).splitlines()
    assert first.startswith("MOVED: 1 sample is not explained")
    assert first.endswith("most likely the offset of joint 3 of hand, by 0.200 ± 0.050 deg")
    assert others[0] == "check what was bumped or loosened there, and calibrate again"


def test_at_most_six_outliers_are_listed() -> None:
    """The text of a verification lists at most six excluded samples."""
    for count, lines in ((6, 6), (7, 6)):
        still = replace(MOVED, moved=False, alternatives=(), outliers=tuple(range(count)))
        assert verification_text(still).count("was left out") == lines


def test_verification_without_shift_is_undecided() -> None:
    """A verification without a shift, or without a verdict, is undecided, whatever else is known."""
    assert verification_text(replace(MOVED, shift=None)).startswith("UNDECIDED")
    assert verification_text(replace(MOVED, moved=None)).startswith("UNDECIDED")


def test_shift_angle_is_in_degrees() -> None:
    """The JSON has the angle of a shift in degrees and the equally likely alternatives.

    The shift of a joint has no transform.
    """
    assert round(verification_dict(MOVED)["shift_deg"], 9) == 0.5
    assert verification_dict(MOVED)["alike"] == ["joint 3 of hand"]
    assert verification_dict(replace(MOVED, shift=JOINT))["transform"] is None


def test_history_has_one_line_per_verification() -> None:
    """Each verification has a line with its verdict, p and shifts; the drifts follow."""
    other = replace(PAST, moved=False, chance=0.4, shifts={}), replace(PAST, moved=None, chance=1.0)
    assert history_text([PAST, *other], [DRIFT]).splitlines() == [
        "2026-03-04 05:06  MOVED, hand_base (p = 1e-07)  a_from_b 5.0 mm",
        "2026-03-04 05:06  not moved (p = 0.4)  ",
        "2026-03-04 05:06  cannot tell (p = 1)  a_from_b 5.0 mm",
        "a_from_b drifts 0.50 ± 0.10 mm a day over 5 checks (p = 1e-05)",
    ]
    assert history_text([], []) == "nothing was verified yet: basecal verify CELL NEW.jsonl"


def test_insignificant_drift_is_denied() -> None:
    """A drift with a large p is reported as no drift, with its rate and sigma."""
    assert drift_sentence(replace(DRIFT, chance=0.3)).startswith("a_from_b does not drift: 0.50 ± 0.10 mm a day")


def test_history_is_written_as_json() -> None:
    """The JSON of a history has lengths in mm and rates in mm per day along each axis."""
    data = json.loads(json.dumps(history_dict([PAST, replace(PAST, detectable_m=None)], [DRIFT])))
    first, second = data["verifications"]
    assert first == {
        "when": "2026-03-04T05:06:07Z",
        "run": "r1",
        "samples": 4,
        "moved": True,
        "frame": "hand_base",
        "p": 1e-7,
        "detectable_mm": 0.4,
        "shift_mm": {"a_from_b": 5.0},
    }
    assert second["detectable_mm"] is None
    (drift,) = data["drift"]
    np.testing.assert_allclose(drift["mm_per_day"], [0.3, 0, 0.4])
    np.testing.assert_allclose(drift["sigma_mm_per_day"], [0, 0.06, 0.08])
    assert (drift["transform"], drift["verifications"], drift["p"]) == ("a_from_b", 5, 1e-5)


def test_runs_agree_if_all_comparisons_agree() -> None:
    """One comparison that disagrees decides, then one that is undecided.

    A transform that only the first run has is listed with that run's name.
    """
    difference = {"a_from_b": Difference(2e-3, np.radians(0.1), 4.5, 1e-6)}
    same = Comparison(difference, {"c_from_d": 0}, (), {}, True)
    unknown, other = replace(same, agree=None), replace(same, agree=False)
    names = ["one", "two", "three"]
    assert comparison_text(names, [same, same]).startswith("AGREE")
    assert comparison_text(names, [same, unknown]).startswith("UNDECIDED")
    assert comparison_text(names, [other, unknown]).startswith("DISAGREE")
    assert comparison_dict(names, [same, same])["agree"] is True
    assert comparison_dict(names, [same, unknown])["agree"] is None
    assert comparison_dict(names, [same, same])["differences"][1]["only"] == {"c_from_d": "one"}
    assert "  c_from_d is only in one" in comparison_text(names, [same, same]).splitlines()
    found = comparison_dict(names, [same, same])["differences"][0]["transforms"]["a_from_b"]
    np.testing.assert_allclose([found["shift_deg"], found["sigmas"], found["p"]], [0.1, 4.5, 1e-6])
