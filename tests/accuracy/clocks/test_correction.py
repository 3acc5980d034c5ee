"""Tests of answers with estimated clocks."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.clocks.correction import (
    apply_remaining_step,
    clock_findings,
    clock_offsets,
    line_times,
    remaining_step,
)
from basecal.accuracy.clocks.search import ClockedRecording
from basecal.accuracy.clocks.step import ClockStep
from basecal.cell import Clock, Recording, RollingShutter
from basecal.estimation.problem.build import build_problem
from basecal.estimation.solve import Solution, solve_problem
from basecal.estimation.streams.rolling_shutter import line_time_name
from basecal.estimation.streams.streams import recording_streams, synchronise
from stream_cells import MOUNT, Streamed, imaged, streamed

NAME = "arm_flange_from_wrist"


def solve_streams(made: Streamed, offset_s: float) -> tuple[ClockedRecording, Solution]:
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    offsets = {"arm": 0.0, "wrist": offset_s}
    of = ClockedRecording(streams, offsets, synchronise(streams, offsets))
    return of, solve_problem(build_problem(made.cell, of.recording)[0], made.cell)


def test_answer_moves_to_optimum_of_offset() -> None:
    """An answer two milliseconds off the optimum moves to that of the optimal offset."""
    made = streamed()
    at, optimum = solve_streams(made, 0.03)
    best_s = 0.03 + float(remaining_step(at, optimum).step_s[0])
    _, optimum = solve_streams(made, best_s)
    aside, solution = solve_streams(made, best_s + 2e-3)
    moved = apply_remaining_step(solution, remaining_step(aside, solution))
    before, after = (
        (optimum.state.transforms[NAME].inverse() @ s.state.transforms[NAME]).log() for s in (solution, moved)
    )
    assert np.linalg.norm(after) < 0.02 * np.linalg.norm(before)


def test_covariance_includes_offset() -> None:
    """The covariance of the answer includes that of the clock offset."""
    of, solution = solve_streams(streamed(), 0.03)
    left = remaining_step(of, solution)
    wider = apply_remaining_step(solution, left).covariance - solution.covariance
    np.testing.assert_allclose(wider, left.covariance[0, 0] * left.by_offsets @ left.by_offsets.T, atol=1e-18)
    assert np.trace(wider) > 0.05 * np.trace(solution.covariance)


def test_estimated_and_stated_offsets_are_reported() -> None:
    """Estimated offsets are reported with sigma, stated ones with zero sigma."""
    of, solution = solve_streams(streamed(), 0.03)
    (clock,) = clock_offsets(of, remaining_step(of, solution)).values()
    assert clock.offset_s == pytest.approx(0.03, abs=3.3 * clock.sigma_s)
    of, solution = solve_streams(streamed(clock=Clock(offset_s=0.03)), 0.03)
    assert {n: (c.offset_s, c.sigma_s) for n, c in clock_offsets(of, remaining_step(of, solution)).items()} == {
        "wrist": (0.03, 0.0)
    }


def test_unobservable_clock_is_finding_without_offset() -> None:
    """A clock that no motion shows has no offset and an unobservable-direction info."""
    found = calibrate(*(lambda m: (m.cell, m.recording))(streamed(still=True)))
    assert "wrist" not in found.clocks
    wrist_findings = [f for f in found.findings if f.about == ("wrist",)]
    assert [(f.code, f.severity) for f in wrist_findings] == [("unobservable-direction", "info")]
    assert "The robots move too little" in wrist_findings[0].message


def test_contradicted_clock_prior_is_named() -> None:
    """A contradicted clock prior is named with the entry to write."""
    of, solution = solve_streams(streamed(clock=Clock("prior", 0.01, 1e-3)), 0.029)
    (finding,) = clock_findings(of, remaining_step(of, solution))
    assert (finding.code, finding.severity) == ("prior-contradicted", "warning")
    assert "clock of wrist" in finding.message
    assert re.fullmatch(
        r".*write `clock: \{status: free, offset_s: 0\.0[23]\d*\}` at wrist in cell\.yaml\.", finding.do[0]
    )


@pytest.mark.journey
def test_calibration_of_streams_is_correct_with_clock() -> None:
    """A calibration of streams is good, within its covariance, and reports the clock offset."""
    made = streamed()
    found = calibrate(made.cell, made.recording)
    assert found.verdict == "good"
    assert found.clocks["wrist"].offset_s == pytest.approx(0.03, abs=3.3 * found.clocks["wrist"].sigma_s)
    xi = (found[NAME].mean.inverse() @ MOUNT).log()
    assert xi @ np.linalg.solve(found[NAME].covariance, xi) < 22.5  # 99.9 % of chi-square with 6 freedoms


@pytest.mark.journey
def test_paths_have_no_stops():
    """Views a third of a millisecond apart, with hundredths of a millimetre of motion, give no `same-stop`."""
    made, other = streamed(seconds=4.0), streamed(seconds=4.0, seed=1)
    views = [sample for sample in other.recording.samples if sample.observations]
    later = tuple(replace(s, sample=5000 + s.sample, stamp_s=s.stamp_s + 3e-4) for s in views)
    found = calibrate(made.cell, Recording((*made.recording.samples, *later)))
    assert "same-stop" not in {f.code for f in found.findings}


@pytest.mark.journey
def test_clock_drift_is_named():
    """A clock drift of 20 ms in 8 s, of which the views see seven, is found beside the offset."""
    made = streamed()
    drifting = tuple(
        replace(sample, stamp_s=sample.stamp_s + 0.02 * (sample.stamp_s / 8 - 0.5)) if sample.observations else sample
        for sample in made.recording.samples
    )
    found = calibrate(made.cell, Recording(drifting))
    (finding,) = [finding for finding in found.findings if finding.code == "clock-offset"]
    assert (finding.severity, finding.about) == ("warning", ("wrist",))
    assert "The clock of wrist drifts: its images fall behind" in finding.message
    assert found.verdict == "doubtful"


@pytest.mark.journey
def test_estimated_line_time_has_sigma():
    """An estimated line time is reported with its sigma, and the answer is within its covariance."""
    made = imaged(2e-5, RollingShutter("prior", 1.7e-5, 4e-6), seconds=5.0)
    found = calibrate(made.cell, made.recording)
    line = found.line_times["wrist"]
    assert line.line_time_s == pytest.approx(2e-5, abs=3.3 * line.sigma_s)
    assert 0 < line.sigma_s < 1e-6
    assert found.clocks == {}
    xi = (found[NAME].mean.inverse() @ MOUNT).log()
    assert xi @ np.linalg.solve(found[NAME].covariance, xi) < 22.5


@pytest.mark.journey
def test_unstated_rolling_shutter_is_found():
    """An unstated rolling shutter is found and not reported as a moved base."""
    made = imaged(2e-5, None, seconds=5.0)
    found = calibrate(made.cell, made.recording)
    assert found.verdict == "good"
    line = found.line_times["wrist"]
    assert line.line_time_s == pytest.approx(2e-5, abs=3.3 * line.sigma_s)
    xi = (found[NAME].mean.inverse() @ MOUNT).log()
    assert xi @ np.linalg.solve(found[NAME].covariance, xi) < 22.5


@pytest.mark.slow
def test_line_time_far_from_prior_is_named():
    """A line time far from its prior is named as contradicted."""
    made = imaged(2e-5, RollingShutter("prior", 1e-5, 1e-6), seconds=5.0)
    found = calibrate(made.cell, made.recording)
    (finding,) = [f for f in found.findings if f.code == "prior-contradicted"]
    assert finding.what.startswith(("The line time of wrist is 20", "The line time of wrist is 19"))


def describe_clock(
    known: Clock, offset_s: float, step_s: float, seen: bool = True, name: str = "wrist"
) -> list[tuple[str, ...]]:
    """Severity, code, device and message about a clock with this statement, offset and remaining step."""
    streams = SimpleNamespace(cell=SimpleNamespace(cameras={"wrist": None}), clocks={name: known})
    left = ClockStep((name,), np.array([step_s]), np.eye(1), np.zeros((6, 1)), np.array([seen]))
    found = clock_findings(SimpleNamespace(streams=streams, offsets_s={name: offset_s}), left)
    return [(f.severity, f.code, *f.about, f.message) for f in found]


def test_offsets_include_remaining_step() -> None:
    """Offsets include the remaining step and have sigmas.

    Stated ones are unchanged; zero or unobservable ones are omitted.
    """
    offsets = {"a": 0.03, "b": 0.2, "c": 0.0, "d": 0.4, line_time_name("wrist"): 1e-5, line_time_name("other"): 3e-5}
    streams = SimpleNamespace(cell=SimpleNamespace(cameras={"wrist": None, "other": None, "third": None}))
    left = ClockStep(
        ("a", "b", line_time_name("wrist")), np.array([2e-3, 0.0, -1e-6]), np.diag([4e-8, 1.0, 9e-16]),
        np.zeros((6, 3)), np.array([True, False, True]),
    )  # fmt: skip
    of = SimpleNamespace(streams=streams, offsets_s=offsets)
    offsets_and_sigmas = {name: (each.offset_s, each.sigma_s) for name, each in clock_offsets(of, left).items()}
    assert offsets_and_sigmas == {"a": (pytest.approx(0.032), pytest.approx(2e-4)), "d": (0.4, 0.0)}
    lines = {name: (each.line_time_s, each.sigma_s) for name, each in line_times(of, left).items()}
    assert lines == {"wrist": (pytest.approx(9e-6), pytest.approx(3e-8)), "other": (3e-5, 0.0)}


@pytest.mark.parametrize(
    ("step_s", "contradicted"), [(2.8e-3, False), (3.1e-3, True), (-4.8e-3, False), (-5.1e-3, True)]
)
def test_clock_prior_is_contradicted_beyond_3_9_sigmas(step_s: float, contradicted: bool) -> None:
    """A clock prior is contradicted from 3.9 sigmas on.

    The final offset counts: it is already 1 ms from a prior of 1 ms, to either side.
    """
    found = describe_clock(Clock("prior", 0.02, 1e-3), 0.021, step_s)
    assert bool(found) == contradicted
    if contradicted:
        off_ms, sigmas = ("24.1", "4.1") if step_s > 0 else ("15.9", "4.1")
        words = f"The clock of wrist is {off_ms} ms off, {sigmas} sigma from its prior of 20.0 ms. Check the prior"
        assert found[0][:3] == ("warning", "prior-contradicted", "wrist")
        assert words in found[0][3]
    assert describe_clock(Clock("free", 0.02), 0.021, step_s) == []


def test_line_times_are_in_microseconds() -> None:
    """Line times are reported in microseconds for their camera: contradicted, or kept without motion."""
    name = line_time_name("wrist")
    (found,) = describe_clock(Clock("prior", 2e-5, 1e-6), 2.5e-5, 1e-6, name=name)
    assert found[:3] == ("warning", "prior-contradicted", "wrist")
    assert "The line time of wrist is 26.00 us, 6.0 sigma from its prior of 20.00 us." in found[3]
    (found,) = describe_clock(Clock("free", 2e-5), 2.5e-5, 0.0, seen=False, name=name)
    assert found[:3] == ("info", "unobservable-direction", "wrist")
    assert "The line time of wrist is unobservable" in found[3]
    assert "The value 25.0 us is kept, without effect on the result" in found[3]
    (found,) = describe_clock(Clock("free", 2e-5), 0.0254, 0.0, seen=False)
    assert (
        "The clock of wrist is unobservable. The robots move too little while it records. The value 0.025 s" in found[3]
    )
