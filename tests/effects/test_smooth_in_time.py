"""Tests of errors of moving arms that are nearly equal at nearby instants."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Calibration, Recording, RobotState
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.effects.smooth_in_time import LASTS_S, errors, kernel
from basecal.geometry import SE3
from stream_cells import MOUNT, Streamed, streamed

NAME = "arm_flange_from_wrist"
LAG = np.repeat([2e-3, 4e-3], 3)  # four times the error of the views


def test_covariance_of_modes_is_time_kernel():
    """Mode covariances are the kernel, except for changes within 0.2 s, which are noise of single stops.

    At rest there are none.
    """
    times = np.append(0.2 * np.arange(60), np.nan)
    found = errors(times)
    alike = np.einsum("iak,jbk->abij", found.by_stop, found.by_stop)
    assert not np.any(found.by_stop[-1])
    expected = kernel(times[:-1], times[:-1])
    apart = expected < np.exp(-0.7)
    for coordinate in range(6):
        np.testing.assert_allclose(alike[coordinate, coordinate, :-1, :-1][apart], expected[apart], atol=0.1)
    assert not np.any(alike[0, 1])


def test_mode_density_is_constant_in_long_recordings():
    """There is at least one mode per second, up to two minutes; a gap of a day takes none."""
    of_10, of_60 = (errors(np.arange(0, seconds, 0.2)).by_stop.shape[2] / 6 for seconds in (10, 60))
    assert of_10 / 10 == pytest.approx(of_60 / 60, rel=0.2)
    assert of_60 > 60
    two_ways = np.concatenate([np.arange(0, 5, 0.2), 86400 + np.arange(0, 5, 0.2)])
    assert errors(two_ways).by_stop.shape[2] / 6 == pytest.approx(of_10, abs=2)


def make_lagging_stream(seed: int, size: float, stated_sigma: float | None = None) -> Streamed:
    """Return a stream whose recorded poses have errors of `LAG` times a size that last for a second.

    The arm states `stated_sigma` as its repeatability.
    """
    made, rng = streamed(seed=seed, seconds=8.0, stated=False), np.random.default_rng(50 + seed)
    samples, last_s, off = [], -np.inf, np.zeros(6)
    for sample in sorted(made.recording.samples, key=lambda each: each.stamp_s):
        if sample.robots:
            kept = np.exp(-(sample.stamp_s - last_s) / LASTS_S)
            off, last_s = kept * off + np.sqrt(1 - kept**2) * rng.standard_normal(6), sample.stamp_s
            pose = sample.robots["arm"].base_from_flange @ SE3.exp(size * LAG * off)
            samples.append(replace(sample, robots={"arm": RobotState(pose)}))
        else:
            samples.append(sample)
    noise = None if stated_sigma is None else np.full(6, stated_sigma)
    cell = replace(made.cell, robots={"arm": replace(made.cell.robots["arm"], noise=noise)})
    return Streamed(cell, Recording(tuple(samples)), made.offset_s)


@cache
def calibrate_stream(seed: int, size: float, stated_sigma: float | None = None) -> Calibration:
    """Return the calibration of a stream with a lag."""
    made = make_lagging_stream(seed, size, stated_sigma)
    return calibrate(made.cell, made.recording)


@pytest.mark.journey
def test_time_errors_are_reported_only_if_present():
    """The noise reports lagging errors with their sigma at the flange, and none for a clean stream."""
    clean, late = calibrate_stream(0, 0.0), calibrate_stream(0, 1.0)
    assert clean.noise["robots"]["arm"].get("smooth_in_time") is None
    figures = late.noise["robots"]["arm"]["smooth_in_time"]
    assert figures["lasts_s"] == LASTS_S
    np.testing.assert_allclose(figures["sigma"], LAG, rtol=0.6)


@pytest.mark.journey
def test_stated_repeatability_allows_lag():
    """A lag of half a millimetre beside a stated repeatability makes no answer doubtful, and sigmas are correct."""
    distances = []
    for seed in range(2):
        found = calibrate_stream(seed, 0.3, stated_sigma=1e-4)
        off = (found[NAME].mean.inverse() @ MOUNT).log()
        distances.append(off @ np.linalg.solve(found[NAME].covariance, off))
        assert found.verdict == "good"
    assert 1 < np.mean(distances) < 12  # 6 on average


@pytest.mark.journey
def test_lag_is_not_attributed_to_stretch(monkeypatch):
    """Answers are good with correct sigmas. With only an error per stop, warnings concern poses and lengths."""
    distances = []
    for seed in (0, 2, 3):
        found = calibrate_stream(seed, 1.0)
        off = (found[NAME].mean.inverse() @ MOUNT).log()
        distances.append(off @ np.linalg.solve(found[NAME].covariance, off))
        assert found.verdict == "good"
    assert 1 < np.mean(distances) < 12  # 6 on average
    monkeypatch.delitem(RANDOM_EFFECTS, "smooth_in_time")
    alone = calibrate(*(lambda made: (made.cell, made.recording))(make_lagging_stream(0, 1.0)))
    assert "stretch" in {finding.code for finding in alone.findings if finding.severity == "warning"}


@pytest.mark.journey
def test_moved_base_is_not_attributed_to_lag():
    """A base moved by 30 mm halfway is detected.

    Time errors whose sigma was estimated together with the move would absorb it.
    """
    made = make_lagging_stream(2, 0.5)
    stamps = [sample.stamp_s for sample in made.recording.samples]
    samples = []
    for sample in made.recording.samples:
        if sample.robots and sample.stamp_s > np.mean(stamps):
            pose = sample.robots["arm"].base_from_flange
            moved = SE3(pose.rotation, pose.translation + np.array([0.02, -0.02, 0.01]))
            samples.append(replace(sample, robots={"arm": RobotState(moved)}))
        else:
            samples.append(sample)
    found = calibrate(made.cell, Recording(tuple(samples)))
    assert "base-moved" in {finding.code for finding in found.findings if finding.severity != "info"}


def test_time_errors_correlate_for_a_second():
    """The kernel is an exponential of the time between two lists of instants."""
    found = kernel(np.array([0.0, 3.0]), np.array([0.0, 1.0, 5.0]))
    np.testing.assert_allclose(found, np.exp([[0, -1, -5], [-3, -2, -2]]))
    assert errors(np.array([np.nan, np.nan])) is None
    assert errors(np.zeros(0)) is None
