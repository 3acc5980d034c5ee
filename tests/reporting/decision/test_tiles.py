"""Tests of the tiles at the top of a page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from basecal.accuracy.fit_details import FitDetails
from basecal.accuracy.task.expected_error import ExpectedError
from basecal.cell import (
    BudgetEntry,
    Calibration,
    Cell,
    Finding,
    MeetingError,
    Outlier,
    Recording,
    Residuals,
    Robot,
    Sample,
    SampleResidual,
    Tolerance,
    Validation,
)
from basecal.geometry import SE3, PoseEstimate
from basecal.reporting.decision.tiles import check_words, error_tile, expected_error_m, passed_checks, remarks, tiles
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"
CELL = simulate(Scenario(samples=2), 0).cell
DETAILS = FitDetails(errors=(ExpectedError(BASE, 4.384e-4, np.zeros(3)),))
RECORDING = Recording(tuple(map(Sample, range(3))))
CALIBRATION = Calibration(
    "good",
    {BASE: PoseEstimate(SE3.identity(), np.diag([1e-8] * 3 + [1e-8] * 3))},
    residuals=Residuals(0.119, per_sample=(SampleResidual(0, "wrist", "board", 0.2),)),
    validation=Validation("k-fold", 5, 1.069, 1.753e-3, np.radians(0.393)),
    outliers=(Outlier(0, "wrist", "board", (3, 4), "far"),),
)
DOCUMENT = Path(__file__).parents[3] / "docs" / "findings.md"


def test_known_quantities_have_tiles() -> None:
    """Each quantity has two digits, and a bar only beside a tolerance."""
    found = [(tile.value, tile.name) for tile in tiles(CELL, RECORDING, CALIBRATION, DETAILS)]
    assert found == [
        ("0.44 mm", "expected error, 95 %"),
        ("0.17 mm, 0.0099 deg", f"1 sigma (3-D norm) of {BASE}"),
        ("1.8 mm, 0.39 deg", "on held-out samples, rms"),
        ("0.12 px", "reprojection error, rms, held out 1.1 px"),
        ("1 of 3", "samples used, 2 points left out"),
    ]
    bare = [tile.name for tile in tiles(CELL, Recording(), Calibration("refused"), FitDetails())]
    assert bare == []


def test_tolerance_is_beside_the_error() -> None:
    """A tolerance is met, missed or open. The expected error at a task precedes that of the recorded places."""
    for expected, kind, shown in ((4e-4, "within", "0.40 mm"), (4e-3, "beyond", "4.0 mm")):
        calibration = replace(CALIBRATION, tolerance=Tolerance(1e-3, expected, kind == "within"))
        first = next(iter(tiles(CELL, RECORDING, calibration, DETAILS)))
        assert (first.kind, first.value, first.name) == (kind, shown, "expected error, 95 %; tolerance 1 mm")
    assert error_tile(4e-3, 1e-3, is_final=False).kind == "open"
    assert expected_error_m(CELL, replace(CALIBRATION, tolerance=Tolerance(1e-3, None, False)), DETAILS) is None
    assert expected_error_m(CELL, CALIBRATION, FitDetails()) is None
    at_work = replace(CALIBRATION, meeting=MeetingError(6e-4, "recorded places", 2e-4))
    assert expected_error_m(CELL, at_work, DETAILS) == 6e-4


def test_remarks_summarise_findings_and_outlook() -> None:
    """Remarks count findings by severity and state the largest source and the effect of more samples."""
    found = Finding("overfit", "warning", (), "x"), Finding("same-stop", "info", (), "y")
    budget = (BudgetEntry("repeatability of hand", 1e-3, 0.7, 5e-4),)
    sentences = list(remarks(replace(CALIBRATION, findings=found, budget=budget), [(0, 2e-3), (40, 1.234e-3)]))
    assert sentences == [
        "1 warning, 1 note.",
        "70 % of the variance at the task comes from repeatability of hand.",
        "40 more samples would leave 1.2 mm (95 %).",
    ]
    assert list(remarks(CALIBRATION, ())) == []


def test_every_check_is_documented() -> None:
    """Every check has words and an entry in docs/findings.md, by the code of its finding."""
    words, text = check_words(), DOCUMENT.read_text(encoding="utf-8")
    assert len(words) > 20
    assert all(f"`{code}`" in text for code in words)
    assert words["overfit"].startswith("prediction errors of held-out samples")


def test_check_with_finding_has_not_passed() -> None:
    """No check has passed if nothing was calibrated."""
    made = Calibration("good", {"a_base_from_b_base": PoseEstimate(SE3.identity(), np.eye(6))})
    doubted = Calibration("doubtful", made.transforms, findings=(Finding("overfit", "warning", (), "x"),))
    assert {code for code, _ in passed_checks(made)} - {code for code, _ in passed_checks(doubted)} == {"overfit"}
    assert list(passed_checks(Calibration("refused"))) == []


@pytest.mark.parametrize(("expected_mm", "tolerance_mm"), [(0.4, 1.0), (4.0, 1.0), (1.0, 1.0)])
def test_bars_are_to_scale(expected_mm: float, tolerance_mm: float) -> None:
    """The larger of error and tolerance ends just before the end of the bar; equal values are within the tolerance."""
    tile = error_tile(1e-3 * expected_mm, 1e-3 * tolerance_mm)
    error, limit = tile.shares
    assert error / limit == pytest.approx(expected_mm / tolerance_mm)
    assert 0.6 < max(error, limit) < 1
    assert tile.kind == ("within" if expected_mm <= tolerance_mm else "beyond")
    assert tile.limit == f"{tolerance_mm:g} mm"
    assert error_tile(4e-3, None).kind == ""


def test_least_known_transform_is_shown() -> None:
    """Of several transforms the least known is shown, a point without an angle."""
    cell = Cell("eye", {name: Robot(name) for name in ("eye", "hand", "third")})
    near, far = (f"eye_base_from_{name}_base" for name in ("hand", "third"))
    sigmas = {near: 1e-3, far: 2e-3}
    known = {name: PoseEstimate(SE3.identity(), np.eye(6) * sigma**2 / 3) for name, sigma in sigmas.items()}
    made = Calibration("good", known)
    (tile,) = tiles(cell, Recording(), made, FitDetails())
    assert (tile.value, tile.name) == ("2.0 mm, 0.11 deg", f"1 sigma (3-D norm) of {far}, the least known")
    (tile,) = tiles(cell, Recording(), replace(made, points=frozenset({far})), FitDetails())
    assert tile.value == "2.0 mm"


def test_held_out_errors_have_tile_or_suffix() -> None:
    """Errors in the image are beside the residuals, those at the target are a tile.

    Excluded points are counted over all views.
    """
    only_pixels = replace(CALIBRATION, validation=Validation("k-fold", 5, 1.069), outliers=None)
    names = [tile.name for tile in tiles(CELL, RECORDING, only_pixels, FitDetails())][1:]
    assert names == ["reprojection error, rms, held out 1.1 px", "samples used"]
    without = replace(CALIBRATION, validation=None)
    assert "reprojection error, rms" in [tile.name for tile in tiles(CELL, RECORDING, without, FitDetails())]
    more = replace(CALIBRATION, outliers=(*CALIBRATION.outliers, Outlier(1, "wrist", "board", (5,), "far")))
    assert list(tiles(CELL, RECORDING, more, FitDetails()))[-1].name == "samples used, 3 points left out"


def test_largest_expected_error_is_used() -> None:
    """There is no expected error if one of the requested transforms is unknown."""
    errors = (ExpectedError(BASE, 4e-4, np.zeros(3)), ExpectedError("other", 6e-4, np.zeros(3)))
    assert expected_error_m(CELL, CALIBRATION, FitDetails(errors=errors)) == 6e-4
    assert expected_error_m(CELL, CALIBRATION, FitDetails(errors=errors[1:])) is None


def test_remarks_have_plurals() -> None:
    """Errors come first, with their plurals; a single step is no outlook."""
    codes = (("x", "info"), ("y", "warning"), ("z", "warning"), ("w", "error"))
    found = tuple(Finding(code, severity, (), "x") for code, severity in codes)
    assert list(remarks(replace(CALIBRATION, findings=found), [(40, 1e-3)])) == ["1 error, 2 warnings, 1 note."]
