"""Tests of the summary of a calibration in the terminal."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import (
    BudgetEntry,
    Calibration,
    Cell,
    CellCamera,
    CellTarget,
    Certificate,
    Finding,
    Rival,
    Robot,
    Tolerance,
    Validation,
)
from basecal.geometry import SE3, PoseEstimate
from basecal.reporting.summary import LINE_WIDTH, summary

BASE = "eye_base_from_hand_base"
LONG = "a_robot_with_a_name_that_tells_where_it_stands_and_whose_it_is_and_what_it_does_all_day_long_" * 2
TOO_FEW = Finding("too-few-samples", "error", (), "2 samples give 4 equations for 18 unknowns: record at least 10")
INFO = Finding("same-stop", "info", ("eye",), "poses of eye differ by 0.02 mm within its 8 stops")


def a_cell(*robots: str) -> Cell:
    eye, *_, last = robots
    things = {"camera": CellCamera("camera", eye)}, {"board": CellTarget("board", last)}
    return Cell(eye, {name: Robot(name) for name in robots}, cameras=things[0], targets=things[1])


def estimate(sigma_m: float, sigma_rad: float, scale: float = 1.0) -> PoseEstimate:
    mean = SE3.from_rpy([0.1, -0.2, 3.0], scale * np.array([1.2345678, -0.0123456, 12.3456789]))
    return PoseEstimate(mean, np.diag([sigma_m**2] * 3 + [sigma_rad**2] * 3))


def good(sigma_m: float = 1e-3, sigma_rad: float = 1e-3) -> Calibration:
    return Calibration("good", {BASE: estimate(sigma_m, sigma_rad)}, {BASE: "free"})


def test_summary_of_good_calibration() -> None:
    """The summary has the verdict with the norms of the sigmas, and the cross-validation errors.

    Translation and rotation are above their sigmas.
    """
    calibration = replace(good(2e-3, 1e-4), validation=Validation("k-fold", 5, 0.2345, 4.123e-4, np.radians(0.0512)))
    assert summary(a_cell("eye", "hand"), calibration).splitlines() == [
        f"GOOD: {BASE} to 3.5 mm and 0.0099 deg (1 sigma, 3-D norm)",
        "  t            1234.6         -12.3       12345.7 mm",
        "  sigma           2.0           2.0           2.0",
        "  rpy          5.7296      -11.4592      171.8873 deg",
        "  sigma        0.0057        0.0057        0.0057",
        "cross-validation error, rms: 0.41 mm and 0.051 deg at the target, 0.23 px",
    ]


@pytest.mark.parametrize(
    ("sigma_mm", "shown"),
    [(0.0, "1234.5678"), (1e-9, "1234.567800"), (0.021, "1234.568"), (0.95, "1234.57"), (37.0, "1235")],
)
def test_digits_follow_the_smallest_sigma(sigma_mm: float, shown: str) -> None:
    """The smallest sigma of a row is shown with two digits, at most six decimals. Exact values have four decimals."""
    rows = summary(a_cell("eye", "hand"), good(sigma_mm * 1e-3)).splitlines()
    assert rows[1].split()[1] == shown


def test_gravest_finding_comes_first() -> None:
    """The gravest finding is the first line with its code, the others follow, and no line is repeated."""
    warning = Finding("overfit", "warning", (), "the cross-validation error is 6 times the residual: record more")
    cause = Finding("outlier-samples", "warning", ("3",), "sample 3 was left out: look at it")
    doubtful = replace(good(), verdict="doubtful", findings=(INFO, warning, cause))
    lines = summary(a_cell("eye", "hand"), doubtful).splitlines()
    assert lines[0] == f"DOUBTFUL: {cause.message} [outlier-samples]"
    assert lines[1].startswith(f"{BASE} to ")
    assert lines[-2:] == [f"warning: {warning.message} [overfit]", f"info: {INFO.message} [same-stop]"]
    assert len(set(lines)) == len(lines)
    refused = summary(a_cell("eye", "hand"), Calibration("refused", findings=(INFO, TOO_FEW)))
    assert refused.splitlines()[0] == f"REFUSED: {TOO_FEW.message} [too-few-samples]"
    assert "sigma" not in refused


def test_many_infos_are_counted_in_one_line() -> None:
    """Twenty infos with the same code are summarised by the code and their number."""
    many = tuple(replace(INFO, what=f"{INFO.what}, {number}") for number in range(20))
    lines = summary(a_cell("eye", "hand"), replace(good(), findings=many)).splitlines()
    assert lines[-1] == "also found, see --verbose: same-stop (20)"


def test_a_point_has_no_angles() -> None:
    """A transform of an LED has only a translation."""
    cell = Cell(
        "arm",
        {"arm": Robot("arm")},
        cameras={"camera": CellCamera("camera", "world")},
        targets={"led": CellTarget("led", "arm")},
    )
    name = "arm_flange_from_led"
    text = summary(cell, replace(good(), transforms={name: estimate(1e-3, 0.0)}, points=frozenset({name})))
    assert "rpy" not in text
    assert "deg" not in text


@pytest.mark.parametrize("robots", [("eye", "hand"), ("a", "b", "c", "d", "e", "f", "g", "h", "i"), ("a", LONG)])
@pytest.mark.parametrize("sigma", [0.0, 1e-12, 1e-4, 1e3])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e5])
def test_lines_have_limited_length(robots: tuple[str, ...], sigma: float, scale: float) -> None:
    """Lines are at most as long as the limit, however long names and messages and however large numbers are.

    The whole summary stays short.
    """
    cell = a_cell(*robots)
    message = " ".join(["the poses of", robots[-1], *["are in millimetres: divide them by 1000"] * 6])
    findings = tuple(Finding(code, "warning", (), message) for code in ("length-unit", "poor-fit", "overfit"))
    transforms = dict.fromkeys(cell.requested_transforms, estimate(sigma, sigma, scale))
    for verdict, found in (("good", ()), ("doubtful", findings)):
        made = replace(good(), verdict=verdict, transforms=transforms, findings=found)
        lines = summary(cell, made).splitlines()
        assert max(map(len, lines)) <= LINE_WIDTH
        assert len(lines) <= 15 + (20 if found else 6)
        assert not re.search(r"nan|inf\b|e[-+]\d", " ".join(line for line in lines if line.startswith("  t ")))


def test_task_error_has_one_line() -> None:
    """The error at the task has one line with the whole error and the sources that contribute most."""
    budget = tuple(
        BudgetEntry(f"source {k}", rms, rms**2 / 30e-6, 1e-3) for k, rms in enumerate((5e-3, 2e-3, 1e-3, 0.0))
    )
    text = summary(a_cell("eye", "hand"), replace(good(), budget=budget))
    assert (
        "error at the task 5.5 mm rms; shares of its variance: source 0 83 %, source 1 13 %, source 2 3 %"
        in text.splitlines()
    )


def test_each_compared_method_has_a_line() -> None:
    """The held-out errors of other methods are below ours; a method that failed is reported as such."""
    rivals = (Rival("basecal", 1e-3, 0.01), Rival("OpenCV LI"))
    lines = summary(
        Cell("a", {"a": Robot("a")}), Calibration("good", validation=Validation("k-fold", 5, rivals=rivals))
    )
    assert "basecal                1.000 mm    0.5730 deg, held out" in lines
    assert "OpenCV LI          fails" in lines


@pytest.mark.parametrize(
    ("certificate", "line"),
    [
        (None, None),
        (Certificate(2e-9, True), "certificate: global optimum proven; relative duality gap of the rotations 2e-09"),
        (Certificate(None, None, "a lens is free"), "certificate: not proven: a lens is free"),
    ],
)
def test_requested_certificate_has_a_line(certificate: Certificate | None, line: str | None) -> None:
    """The line states whether the optimum is proven, or why not. It is missing if no certificate was requested."""
    lines = summary(a_cell("eye", "hand"), replace(good(), certificate=certificate)).splitlines()
    assert [each for each in lines if each.startswith("certificate")] == ([] if line is None else [line])


def rows_of(lines: list[str]) -> int:
    return sum(line.startswith("  t ") for line in lines)


@pytest.mark.parametrize(("robots", "full"), [(4, 3), (5, 3), (3, 2)])
def test_at_most_three_transforms_show_numbers(robots: int, full: int) -> None:
    """Every further transform has a single line with its accuracy."""
    cell = a_cell(*(f"r{k}" for k in range(robots)))
    transforms = dict.fromkeys(cell.requested_transforms, estimate(1e-3, 1e-3))
    lines = summary(cell, replace(good(), transforms=transforms)).splitlines()
    assert rows_of(lines) == full
    assert sum("(1 sigma, 3-D norm)" in line for line in lines) == robots - 1


@pytest.mark.parametrize(("count", "also"), [(4, None), (5, "also found, see --verbose: code4")])
def test_at_most_four_findings_show_text(count: int, also: str | None) -> None:
    """Further findings are listed by their codes if there is no room for them."""
    long = " ".join(["it is said at length"] * 20)
    findings = tuple(Finding(f"code{k}", "warning", (), f"{k}: {long}") for k in range(count))
    lines = summary(a_cell("eye", "hand"), replace(good(), verdict="doubtful", findings=findings)).splitlines()
    assert [line for line in lines if line.startswith("also found")] == ([] if also is None else [also])
    assert sum(line.startswith("warning: ") for line in lines) == 3


@pytest.mark.parametrize(("count", "full"), [(9, True), (10, False)])
def test_infos_show_text_up_to_fourteen_lines(count: int, full: bool) -> None:
    """Five lines of the answer and nine infos are shown in full. Ten infos are summarised by their codes and counts."""
    infos = tuple(Finding(f"code{k // 2}", "info", (), f"info {k}.") for k in range(count))
    lines = summary(a_cell("eye", "hand"), replace(good(), findings=infos)).splitlines()
    if full:
        assert len(lines) == 14
        assert lines[-1] == "info: info 8. [code4]"
    else:
        assert lines[-1] == "also found, see --verbose: code0 (2), code1 (2), code2 (2), code3 (2), code4 (2)"


def test_tolerance_verdict_comes_first() -> None:
    """PASS or FAIL comes first, with findings after it.

    DOUBTFUL precedes it, and a refused calibration states no tolerance.
    """
    warning = Finding("overfit", "warning", (), "It is overfit.")
    met = Tolerance(1e-3, 4e-4, True)
    sentence = "expected error 0.40 mm (95 %), tolerance 1 mm"
    first, second, *_ = summary(a_cell("eye", "hand"), replace(good(), tolerance=met, findings=(warning,))).splitlines()
    assert (first, second) == (f"PASS: {sentence}", "warning: It is overfit. [overfit]")
    doubtful = replace(good(), verdict="doubtful", tolerance=met, findings=(warning,))
    first, second, *_ = summary(a_cell("eye", "hand"), doubtful).splitlines()
    assert (first, second) == ("DOUBTFUL: It is overfit. [overfit]", sentence)
    refused = summary(a_cell("eye", "hand"), Calibration("refused", tolerance=met, findings=(TOO_FEW,)))
    assert sentence not in refused
    assert summary(a_cell("eye", "hand"), Calibration("refused")) == "REFUSED: no requested transform is observable."
