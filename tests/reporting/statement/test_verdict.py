"""Tests of the verdict: its word, its sentence, and the exit code."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from basecal.cell import (
    Calibration,
    Cell,
    CellCamera,
    CellTarget,
    Driver,
    Finding,
    HeldGauge,
    MeetingError,
    Robot,
    Tolerance,
)
from basecal.cell.calibration import Validation, Verdict
from basecal.cli.calibrate import exit_code
from basecal.geometry import SE3, PoseEstimate
from basecal.reporting.statement.verdict import (
    Headline,
    calibrate_command,
    headline,
    held_out_errors,
    missed_step,
    shown_decimals,
    sort_by_severity,
    tangent_text,
)
from basecal.reporting.summary import summary
from basecal.reporting.text import text_report

CELL = Cell(
    "eye",
    {name: Robot(name) for name in ("eye", "hand")},
    cameras={"wrist": CellCamera("wrist", "eye")},
    targets={"board": CellTarget("board", "hand")},
)
DOUBT = Finding("overfit", "warning", (), "residuals are 6 times too small")
KNOWN = {"eye_base_from_hand_base": PoseEstimate(SE3.identity(), 1e-8 * np.eye(6))}


@pytest.mark.parametrize(
    ("verdict", "expected_m", "word", "code"),
    [
        ("good", None, "GOOD", 0),
        ("good", 4.38e-4, "PASS", 0),
        ("good", 4.38e-3, "FAIL", 5),
        ("doubtful", None, "DOUBTFUL", 1),
        ("doubtful", 4.38e-4, "DOUBTFUL", 1),
        ("doubtful", 4.38e-3, "FAIL", 5),
        ("refused", None, "REFUSED", 4),
        ("refused", 4.38e-4, "REFUSED", 4),
        ("refused", 4.38e-3, "REFUSED", 4),
    ],
)
def test_verdict_has_one_word_and_exit_code(verdict: Verdict, expected_m: float | None, word: str, code: int) -> None:
    """The first word of the terminal and the report is the verdict, and no other verdict is beside it."""
    tolerance = None if expected_m is None else Tolerance(1e-3, expected_m, verdict == "good" and expected_m < 1e-3)
    found = () if verdict == "good" else (replace(DOUBT, severity="error" if verdict == "refused" else "warning"),)
    made = Calibration(verdict, KNOWN, tolerance=tolerance, findings=found)
    for text in (str(headline(CELL, made)), summary(CELL, made), text_report(CELL, made)):
        assert text.startswith(f"{word}: ")
        assert not {"PASS:", "FAIL:", "GOOD:", "DOUBTFUL:", "REFUSED:"} - {f"{word}:"} & set(text.split())
    assert exit_code(made) == code
    if word in ("PASS", "FAIL") and expected_m is not None:
        error = {4.38e-4: "0.44", 4.38e-3: "4.4"}[expected_m]
        assert headline(CELL, made).sentence.startswith(f"expected error {error} mm (95 %), tolerance 1 mm")


def test_tolerance_on_unknown_transform_fails() -> None:
    """A tolerance for a transform that was not found is missed."""
    made = Calibration("good", KNOWN, tolerance=Tolerance(1e-3, None, False))
    assert str(headline(CELL, made)) == "FAIL: a requested transform is unknown, tolerance 1 mm"


@pytest.mark.parametrize(
    ("where", "words"),
    [
        ("recorded places", "where the arms worked"),
        ("task point", "at the task point"),
        ("task box", "in the task box"),
    ],
)
def test_expected_error_precedes_sigma(where: Literal["task point", "task box", "recorded places"], words: str) -> None:
    """The expected error at the task precedes the transform's sigma; a tolerance replaces it."""
    made = Calibration("good", KNOWN, meeting=MeetingError(4.38e-4, where, 1.5e-4))
    for text in (str(headline(CELL, made)), summary(CELL, made)):
        assert text.startswith(f"GOOD: expected error 0.44 mm (95 %) {words}")
    assert "eye_base_from_hand_base to 0.17 mm" in summary(CELL, made)
    with_tolerance = replace(made, tolerance=Tolerance(1e-3, 4.38e-4, True))
    assert words not in summary(CELL, with_tolerance)


def test_gauge_is_named_beside_its_sigma() -> None:
    """The contribution of a gauge is in the line of its transform in the terminal and the report."""
    name, part = next(iter(KNOWN)), np.diag([0.0, 0.0, 0.0, 0.0, 0.0, 4e-9])
    gauges = (HeldGauge("hand", ("joint_offsets",), part), HeldGauge("eye", ("joint_offsets",), 0 * part))
    made = Calibration("good", KNOWN, order=(name,), joint_covariance=1e-8 * np.eye(6), gauges=gauges)
    clause = ", of which 0 mm and 0.0036 deg by the gauge that holds joint offsets of hand"
    assert f"{name} to 0.17 mm and 0.0099 deg (1 sigma, 3-D norm){clause}" in " ".join(summary(CELL, made).split())
    assert clause in text_report(CELL, made)


def test_missed_tolerance_of_scene_needs_images() -> None:
    """A scene has no plan: images are captured by hand with drivers, or imported."""
    missed = Calibration("good", KNOWN, settings={"method": "scene"})
    assert missed_step(CELL, missed, "cell") == "import more images of each arm, then basecal calibrate cell --scene"
    assert missed_step(replace(CELL, sees_scene=True), missed, "cell").endswith("basecal calibrate cell")
    robots = {name: replace(robot, driver=Driver("simulated")) for name, robot in CELL.robots.items()}
    cameras = {name: replace(camera, driver=Driver("simulated")) for name, camera in CELL.cameras.items()}
    driven = replace(CELL, sees_scene=True, robots=robots, cameras=cameras)
    assert missed_step(driven, missed, "cell") == "basecal capture cell --freedrive"
    planned = Calibration("good", KNOWN, tolerance=Tolerance(1e-3, 2e-3, False))
    assert missed_step(driven, planned, "cell") == "basecal plan cell --tolerance 1mm -o plan.jsonl"


@pytest.mark.parametrize(
    ("settings", "sees_scene", "option"),
    [
        ({"method": "scene"}, False, " --scene"),
        ({"method": "scene"}, True, ""),
        ({"method": "maximum-likelihood", "joins_scene": True}, False, " --scene also"),
        ({"method": "maximum-likelihood", "joins_scene": False}, False, ""),
    ],
)
def test_calibrate_command_keeps_scene_option(settings: dict[str, object], sees_scene: bool, option: str) -> None:
    """The command repeats the scene option, unless the cell itself requests it."""
    cell, made = replace(CELL, sees_scene=sees_scene), Calibration("doubtful", settings=settings)
    assert calibrate_command(cell, made, "cell") == f"basecal calibrate cell{option}"


@pytest.mark.parametrize(("sigma", "decimals"), [(0.0, 4), (0.02, 3), (0.95, 2), (1.0, 1), (37.0, 0), (1e-9, 6)])
def test_smallest_sigma_has_two_digits(sigma: float, decimals: int) -> None:
    """The decimals follow the smallest sigma, whatever the larger ones.

    There are at most six decimals, and four for exact values.
    """
    assert shown_decimals(np.array([sigma, 100 * sigma, 0.0])) == decimals


def test_held_out_errors_are_listed_if_known() -> None:
    """Held-out errors are at the target and in the image, as far as they are known.

    There are none without a validation.
    """
    assert held_out_errors(Validation("k-fold", 5, rms_px=0.31)) == ["0.31 px"]
    both = held_out_errors(Validation("k-fold", 5, target_m=2e-3, target_rad=np.radians(0.1), rms_px=0.31))
    assert both == ["2.0 mm and 0.10 deg at the target", "0.31 px"]
    assert held_out_errors(Validation("k-fold", 5, target_m=2e-3)) == held_out_errors(None) == []


def test_tangent_is_written_as_two_lengths():
    """The lengths are in mm and deg."""
    tangent = np.array([3e-3, 0, 4e-3, 0, *np.radians([0.6, 0.8])])
    assert tangent_text(tangent) == "5.0 mm and 1.0 deg"


def finding(code: str, severity: Literal["error", "warning", "info"] = "warning") -> Finding:
    return Finding(code, severity, (), f"It is {code}.")


def test_reason_counts_other_findings() -> None:
    """Errors and warnings are counted, infos are not; a single finding is a sentence."""

    def doubt(*codes: str) -> str:
        found = (*map(finding, codes), finding("same-stop", "info"))
        return headline(CELL, Calibration("doubtful", KNOWN, findings=found)).doubt

    assert doubt() == ""
    assert doubt("outlier-samples") == "It is outlier-samples."
    assert doubt("outlier-samples", "overfit") == "It is outlier-samples (and 1 more finding)"
    assert doubt("outlier-samples", "overfit", "weak") == "It is outlier-samples (and 2 more findings)"


def test_doubt_is_joined_by_verdict_word() -> None:
    """The word is `but` for a doubtful answer and `doubtful` for one that fails anyway.

    Without a reason there is none.
    """
    assert str(Headline("DOUBTFUL", "a to 1 mm", "it is off")) == "DOUBTFUL: a to 1 mm, but: it is off"
    assert str(Headline("FAIL", "1 mm", "it is off")) == "FAIL: 1 mm; doubtful: it is off"
    assert str(Headline("GOOD", "a to 1 mm.")) == "GOOD: a to 1 mm."


def test_causes_come_before_their_consequences() -> None:
    """Errors come first. Dropped samples precede the finding that there are too few, but only beside it."""
    few = finding("too-few-samples", "error")
    lost, other = finding("dropped-sample"), finding("outlier-samples")
    poor = finding("poor-fit")
    note = finding("same-stop", "info")
    assert sort_by_severity([note, poor, other, lost, few]) == [lost, few, other, poor, note]
    cut = finding("not-converged", "error")
    assert sort_by_severity([poor, lost, cut]) == [cut, lost, poor]
    lost_note = finding("dropped-sample", "info")
    assert sort_by_severity([lost_note, few]) == [few, lost_note]


@pytest.mark.parametrize(
    ("settings", "command"),
    [
        ({}, "basecal calibrate cell"),
        ({"method": "axis-shift"}, "basecal calibrate cell --method axis-shift"),
        ({"tolerance_m": 5e-4}, "basecal calibrate cell --tolerance 0.5mm"),
        ({"task_point": [0.1, -0.25, 0.5]}, "basecal calibrate cell --task-point 0.1 -0.25 0.5"),
        (
            {"task_box": [0, 0, 0, 1, 1, 0.5], "task_point": None, "tolerance_m": 1e-3},
            "basecal calibrate cell --task-box 0 0 0 1 1 0.5 --tolerance 1mm",
        ),
    ],
)
def test_commands_repeat_task_and_tolerance(settings: dict[str, object], command: str) -> None:
    """The command repeats the task and the tolerance with the given digits."""
    assert calibrate_command(CELL, Calibration("good", settings=settings), "cell") == command


def test_headline_of_several_or_no_transforms() -> None:
    """Each transform has its sigma, with the first of the held-out errors at the end."""
    cell = replace(CELL, robots={name: Robot(name) for name in ("eye", "hand", "third")})
    third = {**KNOWN, "eye_base_from_third_base": next(iter(KNOWN.values()))}
    made = Calibration("good", third, validation=Validation("k-fold", 5, 0.3, 2e-3, np.radians(0.1)))
    each = "to 0.17 mm and 0.0099 deg (1 sigma, 3-D norm)"
    assert headline(cell, made).sentence == (
        f"eye_base_from_hand_base {each}; eye_base_from_third_base {each}; "
        "cross-validation error, rms: 2.0 mm and 0.10 deg at the target."
    )
    assert headline(CELL, Calibration("good")).sentence == "no transform is requested, all are fixed."
    assert headline(CELL, Calibration("refused")).sentence == "the requested transforms are unobservable."
