"""One verdict: its word, its sentence, and the exit code."""

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
    calibrate_command,
    headline,
    held_out_errors,
    missed_step,
    shown_decimals,
    tangent_text,
    two_digits,
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
def test_one_word_and_its_code(verdict: Verdict, expected_m: float | None, word: str, code: int) -> None:
    """The first word of terminal and report, and no other verdict beside it."""
    tolerance = None if expected_m is None else Tolerance(1e-3, expected_m, verdict == "good" and expected_m < 1e-3)
    found = () if verdict == "good" else (replace(DOUBT, severity="error" if verdict == "refused" else "warning"),)
    made = Calibration(verdict, KNOWN, tolerance=tolerance, findings=found)
    for said in (str(headline(CELL, made)), summary(CELL, made), text_report(CELL, made)):
        assert said.startswith(f"{word}: ")
        assert not {"PASS:", "FAIL:", "GOOD:", "DOUBTFUL:", "REFUSED:"} - {f"{word}:"} & set(said.split())
    assert exit_code(made) == code
    if word in ("PASS", "FAIL") and expected_m is not None:
        error = {4.38e-4: "0.44", 4.38e-3: "4.4"}[expected_m]
        assert headline(CELL, made).sentence.startswith(f"expected error {error} mm (95 %), tolerance 1 mm")


def test_what_is_not_known_fails() -> None:
    """A tolerance on something that was not found."""
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
def test_the_error_at_the_work_comes_first(
    where: Literal["task point", "task box", "recorded places"], words: str
) -> None:
    """Before the transform's sigma; a tolerance stands for it."""
    made = Calibration("good", KNOWN, meeting=MeetingError(4.38e-4, where, 1.5e-4))
    for said in (str(headline(CELL, made)), summary(CELL, made)):
        assert said.startswith(f"GOOD: expected error 0.44 mm (95 %) {words}")
    assert "eye_base_from_hand_base to 0.17 mm" in summary(CELL, made)
    asked = replace(made, tolerance=Tolerance(1e-3, 4.38e-4, True))
    assert words not in summary(CELL, asked)


def test_a_gauge_is_named_beside_the_sigma_that_it_makes() -> None:
    """In the line of its transform in terminal and report."""
    name, part = next(iter(KNOWN)), np.diag([0.0, 0.0, 0.0, 0.0, 0.0, 4e-9])
    gauges = (HeldGauge("hand", ("joint_offsets",), part), HeldGauge("eye", ("joint_offsets",), 0 * part))
    made = Calibration("good", KNOWN, order=(name,), joint_covariance=1e-8 * np.eye(6), gauges=gauges)
    clause = ", of which 0 mm and 0.0036 deg by the gauge that holds joint offsets of hand"
    assert f"{name} to 0.17 mm and 0.0099 deg (1 sigma, 3-D norm){clause}" in " ".join(summary(CELL, made).split())
    assert clause in text_report(CELL, made)


def test_a_scene_needs_more_images() -> None:
    """No plan is made of a scene: images are captured by hand with drivers, or imported."""
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
def test_a_calibration_is_repeated_as_it_was_made(settings: dict[str, object], sees_scene: bool, option: str) -> None:
    """With its scene, which the cell may request itself."""
    cell, made = replace(CELL, sees_scene=sees_scene), Calibration("doubtful", settings=settings)
    assert calibrate_command(cell, made, "cell") == f"basecal calibrate cell{option}"


@pytest.mark.parametrize(("sigma", "decimals"), [(0.0, 4), (0.02, 3), (0.95, 2), (1.0, 1), (37.0, 0), (1e-9, 6)])
def test_the_smallest_sigma_shows_two_digits(sigma: float, decimals: int) -> None:
    """Whatever larger ones stand beside it; six decimals at most, four of what is exact."""
    assert shown_decimals(np.array([sigma, 100 * sigma, 0.0])) == decimals


@pytest.mark.parametrize(
    ("value", "shown"), [(0.0, "0"), (3.41, "3.4"), (0.0987, "0.099"), (-0.5, "-0.50"), (123.4, "123"), (np.inf, "inf")]
)
def test_two_digits(value: float, shown: str) -> None:
    """Without an exponent; the whole part is never cut."""
    assert two_digits(value) == shown


def test_errors_of_held_out_samples_are_at_the_target_and_in_the_image() -> None:
    """Each as far as it is known; without a validation there are none."""
    assert held_out_errors(Validation("k-fold", 5, rms_px=0.31)) == ["0.31 px"]
    both = held_out_errors(Validation("k-fold", 5, target_m=2e-3, target_rad=np.radians(0.1), rms_px=0.31))
    assert both == ["2.0 mm and 0.10 deg at the target", "0.31 px"]
    assert held_out_errors(Validation("k-fold", 5, target_m=2e-3)) == held_out_errors(None) == []


def test_a_tangent_is_two_lengths():
    """In millimetres and degrees."""
    tangent = np.array([3e-3, 0, 4e-3, 0, *np.radians([0.6, 0.8])])
    assert tangent_text(tangent) == "5.0 mm and 1.0 deg"
