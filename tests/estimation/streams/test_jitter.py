"""Tests of views with time stamp jitter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.shared.stages import without_stages

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.stages.concluding import find_error_at_task
from basecal.accuracy.stages.solving import screen_conventions
from basecal.cell import Calibration, Clock, ClockOffset, Recording
from basecal.effects import lens_sag, mount_bend, mount_play
from basecal.effects.registry import CONTAINED, EFFECTS
from basecal.estimation.problem.build import build_problem
from basecal.estimation.streams.jitter import with_jitter, with_passing_times
from basecal.estimation.streams.rolling_shutter import KnownGeometry
from basecal.estimation.streams.streams import recording_streams, synchronise
from basecal.geometry import SE3
from stream_cells import MOUNT, TAG, Streamed, path_poses, streamed

answers_alone = without_stages(screen_conventions, find_error_at_task)

NAME = "arm_flange_from_wrist"


def with_stamp_jitter(jitter_s: float, seed: int = 0, clock: Clock | None = None, stated: bool = True) -> Streamed:
    """Views with random errors of their time stamps [s]."""
    made, rng = streamed(seed=seed, seconds=6.0, clock=clock, stated=stated), np.random.default_rng(100 + seed)
    samples = tuple(
        replace(s, stamp_s=s.stamp_s + jitter_s * rng.standard_normal()) if s.observations else s
        for s in made.recording.samples
    )
    return Streamed(made.cell, Recording(samples), made.offset_s)


def mount_nees(made: Streamed, found: Calibration) -> float:
    xi = (found[NAME].mean.inverse() @ MOUNT).log()
    return float(xi @ np.linalg.solve(found[NAME].covariance, xi))


def test_views_move_as_targets_do_before_cameras() -> None:
    """The motion of views is the derivative of the target in the camera, scaled by a stated jitter."""
    made = streamed(clock=Clock(offset_s=0.03, jitter_s=2e-3))
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    of = synchronise(streams, streams.stated_offsets)
    known = KnownGeometry(made.cell, {NAME: MOUNT, "arm_base_from_tag": TAG}, {})
    problem = with_jitter(build_problem(made.cell, of.recording)[0], known, of.robots, streams.clocks)
    (group,) = problem.groups
    assert group.motion is not None
    times = np.array([s.stamp_s for s in of.recording.samples])
    seen = [(path_poses(times + shift) @ MOUNT).inverse() @ TAG for shift in (-1e-4, 1e-4)]
    np.testing.assert_allclose(group.motion, (seen[0].inverse() @ seen[1]).log() / 2e-4, atol=2e-3)
    np.testing.assert_array_equal(problem.jitter_motion(group), 2e-3 * group.motion)
    assert problem.open_jitter == frozenset()
    free = with_jitter(problem, known, of.robots, {**streams.clocks, "wrist": Clock(offset_s=0.03)})
    assert free.open_jitter == {"wrist"}
    assert free.jitter_motion(group) is None


@pytest.mark.journey
@pytest.mark.parametrize("stated", [True, False])
def test_jitter_is_estimated_with_the_noise(stated: bool) -> None:
    """A jitter of 5 ms is estimated from fifty views, within a third."""
    found = calibrate(*(lambda m: (m.cell, m.recording))(with_stamp_jitter(5e-3, stated=stated)))
    assert found.noise["clocks"]["wrist"]["jitter_s"] == pytest.approx(5e-3, rel=0.33)
    assert "poor-fit" not in {f.code for f in found.findings}


def test_estimated_jitter_is_small_without_jitter() -> None:
    """Without jitter, the estimate is below 1 ms."""
    made = with_stamp_jitter(0.0)
    assert calibrate(made.cell, made.recording).noise["clocks"]["wrist"]["jitter_s"] < 1e-3


@pytest.mark.journey
def test_stated_jitter_widens_the_clock_offset() -> None:
    """A time stamp error moves views by five of their sigmas.

    The offset is then known as well as a mean of time stamps.
    """
    made = with_stamp_jitter(5e-3, clock=Clock("free", 0.0, None, 5e-3))
    found = calibrate(made.cell, made.recording)
    assert isinstance(found.clocks["wrist"], ClockOffset)
    assert found.clocks["wrist"].sigma_s == pytest.approx(5e-3 / np.sqrt(50), rel=0.4)
    assert found.noise["clocks"] == {"wrist": {"jitter_s": 5e-3}}
    exact = calibrate(made.cell, streamed(seconds=6.0).recording)
    assert exact.clocks["wrist"].sigma_s > 0.5 * found.clocks["wrist"].sigma_s


def with_bends(made: Streamed, seed: int) -> Streamed:
    """Views of a mount and a lens that deform under gravity as much as expected."""
    rng = np.random.default_rng(200 + seed)
    seen = [s for s in made.recording.samples if s.observations]
    flange = path_poses(np.array([s.stamp_s for s in seen]) + made.offset_s)
    down = np.array([0.0, 0.0, -1.0]) @ flange.rotation
    down -= down.mean(0)  # the mean is the mount's
    moves = {
        "mount_bend": mount_bend.flange_tangents(down),
        "mount_play": mount_play.flange_tangents(down),
        "lens_sag": lens_sag.flange_tangents(MOUNT, down),
    }
    assert moves.keys() == set(CONTAINED)
    total = np.zeros((len(seen), 6))
    for name, by_size in moves.items():
        expected = EFFECTS[name].expected
        assert expected is not None
        prior = expected.prior(len(CONTAINED))
        sigma = rng.choice(prior.sigmas, p=prior.probabilities)
        total += by_size @ (sigma * rng.standard_normal(by_size.shape[-1]))
    back = dict(zip((s.sample for s in seen), MOUNT.inverse() @ SE3.exp(-total) @ MOUNT, strict=True))
    samples = []
    for sample in made.recording.samples:
        views = (replace(o, camera_from_target=back[sample.sample] @ o.camera_from_target) for o in sample.observations)
        samples.append(replace(sample, observations=tuple(views)))
    return Streamed(made.cell, Recording(tuple(samples)), made.offset_s)


@pytest.mark.slow
def test_covariance_with_jitter_is_consistent() -> None:
    """For 40 recordings with 4 ms of jitter, and bends as expected, NEES/6 is within 3 standard errors of 1."""
    made = [with_bends(with_stamp_jitter(4e-3, seed), seed) for seed in range(40)]
    found = [calibrate(each.cell, each.recording) for each in made]
    mean = np.mean([mount_nees(*each) for each in zip(made, found, strict=True)])
    assert mean / 6 == pytest.approx(1.0, abs=3 * np.sqrt(2 / (6 * 40)))
    assert sum(each.verdict == "good" for each in found) >= 30  # large bends are reported


@pytest.mark.journey
def test_wrongly_exact_time_stamps_give_a_poor_fit() -> None:
    """Time stamps with 4 ms of jitter that are stated as exact give the finding `poor-fit`."""
    made = with_stamp_jitter(4e-3, clock=Clock("free", 0.0, None, 0.0))
    assert "poor-fit" in {f.code for f in calibrate(made.cell, made.recording).findings}


def passing_group(still: bool):
    """The view group of an arm, and the time stamps of its views."""
    made = streamed(clock=Clock(offset_s=0.03), still=still)
    streams = recording_streams(made.cell, made.recording)
    of = synchronise(streams, streams.stated_offsets)
    (group,) = with_passing_times(build_problem(made.cell, of.recording)[0], of, made.cell).groups
    stamps = {sample.sample: sample.stamp_s for sample in of.recording.samples}
    return group, [stamps[number] for number in group.sample.tolist()]


def test_passing_times_are_those_of_the_views():
    """Passing times on a path are by the clock of the arm. The world, which carries the tag, has none."""
    group, stamps = passing_group(still=False)
    np.testing.assert_array_equal(group.eye.passed_s, stamps)
    assert group.hand.passed_s is None
    np.testing.assert_array_equal(group.take(np.array([3, 5])).eye.passed_s, np.array(stamps)[[3, 5]])


@pytest.mark.parametrize(
    ("still", "sigma", "is_total", "is_open"),
    [(False, 1e-4, False, True), (False, 1e-4, True, False), (True, 1e-4, False, False), (False, 0.0, False, False)],
)
def test_repeatability_does_not_apply_to_a_moving_arm(still, sigma, is_total, is_open):
    """The noise of an arm is open on a path, unless it states its total error, or zero noise."""
    made = streamed(still=still)
    arm = replace(made.cell.robots["arm"], noise=np.full(6, sigma), is_total_noise=is_total)
    cell = replace(made.cell, robots={"arm": arm})
    of = synchronise(streams := recording_streams(cell, made.recording), streams.stated_offsets)
    problem = with_passing_times(build_problem(cell, of.recording)[0], of, cell)
    assert ("arm" in problem.unstated) == is_open
    assert set(problem.stops.robot) == ({"arm"} if sigma else set())


def test_still_arm_has_no_passing_times():
    """Views at stops of a stream have separate errors, like separate samples."""
    group, _ = passing_group(still=True)
    assert np.isnan(group.eye.passed_s).all()
