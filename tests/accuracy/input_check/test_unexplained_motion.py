"""Tests of the share of target motion that robot poses leave unexplained, and of its limits."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.ends import end

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.input_check import unexplained_motion as module
from basecal.accuracy.input_check.unexplained_motion import (
    hopeless_finding,
    is_hopeless,
    joint_offset_findings,
    unexplained_motion,
)
from basecal.cell import Recording
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import STATED
from basecal.estimation.solve import solve
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=16), 3)
PROBLEM, _ = build_problem(MADE.cell, MADE.recording)
TRUE = State(MADE.truth, MADE.cameras, np.zeros((0, 6)))


def reorder_hand(order):
    samples = MADE.recording.samples
    hand = [samples[k].robots["hand"] for k in order]
    changed = (replace(s, robots={**s.robots, "hand": h}) for s, h in zip(samples, hand, strict=True))
    return replace(MADE.recording, samples=tuple(changed))


def test_true_state_leaves_noise_only():
    """At the true state only noise is unexplained: 0.2 px of some hundred."""
    assert unexplained_motion(PROBLEM, TRUE) < 0.01
    assert not is_hopeless(PROBLEM, TRUE)


@pytest.mark.journey
def test_shuffled_poses_leave_motion_unexplained():
    """Shuffled poses leave much of the motion unexplained, whatever is fitted.

    The finding states the share and what to check.
    """
    mixed = solve(MADE.cell, reorder_hand(np.random.default_rng(0).permutation(16)))
    share = unexplained_motion(mixed.problem, mixed.state)
    assert 0.3 < share <= 1.0
    found = hopeless_finding(mixed.problem, mixed.state)
    assert (found.code, found.severity) == ("poor-fit", "error")
    assert f"leave {100 * share:.0f} % of it." in found.message
    assert "one instant" in found.message


@pytest.mark.slow
def test_shuffled_recording_is_refused_as_poor_fit():
    """A shuffled recording is refused with "poor-fit" alone.

    No unobservable direction and no failed convergence are reported: the poses are of other samples.
    """
    found = calibrate(MADE.cell, reorder_hand(np.random.default_rng(0).permutation(16)))
    assert found.verdict == "refused"
    assert [f.code for f in found.findings if f.severity != "info"] == ["poor-fit"]


def test_searched_clocks_are_named_with_their_range():
    """Searched device clocks are named with their range; the line time of a camera is not one."""
    problem, _ = build_problem(MADE.cell, MADE.recording)
    state = State(MADE.truth, MADE.cameras, np.zeros((len(problem.stops), 6)))
    assert "one instant" in hopeless_finding(problem, state).do[0]
    first = hopeless_finding(replace(problem, open_clocks=frozenset({"wrist", "wrist line"})), state).do[0]
    assert first.startswith("If the clock of wrist is off by more than 1 s, state `clock: {status: free")


def test_joint_robots_get_joint_advice():
    """Arms that record joints are advised to check URDF, units and signs.

    Their poses are computed, so a wrong direction or length of a pose is no cause.
    """
    made = simulate(Scenario(samples=6, joints=True), 0)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))
    found = hopeless_finding(problem, state)
    assert found.do[1] == "Check the URDF of eye and hand, and the unit, signs and order of the joints."
    problem, _ = build_problem(MADE.cell, MADE.recording)
    state = State(MADE.truth, MADE.cameras, np.zeros((len(problem.stops), 6)))
    assert "base_from_flange in metres" in hopeless_finding(problem, state).do[1]


def test_best_half_of_views_counts():
    """With 7 of 16 views far off, the others are explained: the best half counts."""
    order = [*np.roll(range(7), 3), *range(7, 16)]
    problem, _ = build_problem(MADE.cell, reorder_hand(order))
    assert not is_hopeless(problem, TRUE)


def test_views_of_one_stop_count_once():
    """Nine copies of one view count once, so the motion of the other views is not hidden."""
    samples = MADE.recording.samples
    many = Recording(tuple(replace(samples[max(k - 9, 0)], sample=k) for k in range(18)))
    problem, _ = build_problem(MADE.cell, many)
    assert unexplained_motion(problem, TRUE) == pytest.approx(
        unexplained_motion(*_first(10)), rel=0.3
    )  # medians of few views differ a little


def _first(count):
    problem, _ = build_problem(MADE.cell, replace(MADE.recording, samples=MADE.recording.samples[:count]))
    return problem, TRUE


def test_small_motion_is_not_unexplained():
    """Copies of one view have no unexplained motion: all of it is noise. Without views the share is zero, too."""
    samples = MADE.recording.samples
    same = Recording(tuple(replace(samples[0], sample=k) for k in range(6)))
    problem, _ = build_problem(MADE.cell, same)
    assert unexplained_motion(problem, TRUE) == 0.0
    assert unexplained_motion(problem.with_groups(()), TRUE) == 0.0


def through_a_long_lens(off_px, count=16):
    """Exact views through a lens ten times as long, and a state whose principal point is off by `off_px`."""
    (group,) = PROBLEM.groups
    lens = MADE.cameras["wrist"]
    parameters = lens.parameters * np.where(np.arange(len(lens.parameters)) < 2, 10.0, 1.0)
    long = lens.with_parameters(parameters)
    predicted = TRUE.camera_from_target(group, PROBLEM.stops)
    pixels = group.measurement.pixels + np.nan_to_num(group.measurement.residual_px(predicted, long))
    seen = replace(group, measurement=replace(group.measurement, pixels=pixels)).take(np.arange(count))
    parameters[2:4] += off_px
    return PROBLEM.with_groups([seen]), replace(TRUE, cameras={"wrist": lens.with_parameters(parameters)})


@pytest.mark.parametrize(("off_px", "lost"), [(0.0, False), (49.0, False), (51.0, True)])
def test_residuals_of_fifty_pixels_are_hopeless(off_px, lost):
    """Residuals above 50 px are hopeless however far the target moves, and are reported in pixels.

    Four stops are too few for this limit.
    """
    problem, state = through_a_long_lens(off_px)
    assert unexplained_motion(problem, state) < 0.2
    assert is_hopeless(problem, state) == lost
    assert f"leave residuals of {off_px:.0f} px." in hopeless_finding(problem, state).message
    for count, is_lost in ((4, False), (5, lost)):
        few = through_a_long_lens(off_px, count)
        assert is_hopeless(*few) == (is_lost or unexplained_motion(*few) > 0.2)


def looks(off, moved, in_pixels=True, stands=None):
    """A group of views, each of its own stop by default."""
    rows = range(len(off)) if stands is None else stands
    ends = [end(stop_number=stand) for stand in (np.array(rows), np.array(rows) % 2)]
    return Group(ends, np.array(off), np.array(moved), in_pixels)


class Group:
    """Views of stops with the given errors and motion."""

    def __init__(self, ends, off, moved, in_pixels):
        self.ends = ends
        self.off, self.moved, self.in_pixels = off, moved, in_pixels
        self.measurement = object.__new__(PixelMeasurement if in_pixels else PoseMeasurement)
        object.__setattr__(self.measurement, "moved", moved)

    def __len__(self):
        return len(self.off)

    def take(self, rows):
        ends = [replace(of, stop_number=of.stop_number[rows]) for of in self.ends]
        return Group(ends, self.off[rows], self.moved[rows], self.in_pixels)


@pytest.fixture
def by_number(monkeypatch):
    """Makes groups of `looks` state their own errors and motion."""
    monkeypatch.setattr(module, "view_errors", lambda problem, group, state: group.off)
    monkeypatch.setattr(module, "view_deviations", lambda measurement: measurement.moved)
    monkeypatch.setattr(module, "trimmed_rms", lambda off, share: float(np.sqrt(np.mean(off**2))))


def share_of(*groups):
    """The share of their motion that is unexplained, with rms over all stops."""
    return unexplained_motion(SimpleNamespace(groups=groups), None)


def test_share_is_unexplained_over_total_motion(by_number):
    """The share is unexplained over total motion of all groups, one view per stop.

    It is at most one, and zero if hardly anything moves.
    """
    one, two = looks([0.3, 0.4], [1.0, 2.0]), looks([0.1, 9.0, 0.5], [2.0, 9.0, 4.0], stands=[1, 1, 2])
    expected = np.sqrt((0.09 + 0.16 + 0.01 + 0.25) / (1 + 4 + 4 + 16))
    assert share_of(one, looks([], []), two) == pytest.approx(expected)
    assert share_of(looks([3.0], [0.5])) == 1.0
    assert share_of(looks([0.011], [0.021])) == pytest.approx(11 / 21)
    assert share_of(looks([0.011], [0.019])) == 0.0
    assert share_of() == 0.0


@pytest.mark.parametrize(("stops", "px"), [(4, 0.0), (5, 60.0)])
def test_pixel_residual_needs_five_stops(by_number, stops, px):
    """The pixel residual needs five stops and counts one view per stop; other measurements do not count."""
    pixels = looks([0.06] * stops + [9.0], [1.0] * (stops + 1), stands=[*range(stops), 0])
    groups = [looks([], []), pixels, looks([5.0] * 9, [1.0] * 9, in_pixels=False)]
    assert module._residual_px(SimpleNamespace(groups=groups), None) == pytest.approx(px)


@pytest.mark.parametrize(
    ("share", "left_px", "phrase"),
    [(0.19, 49.0, None), (0.21, 0.0, "21 % of it."), (0.19, 51.0, "residuals of 51 px")],
)
def test_hopeless_limits_are_fifth_of_motion_or_fifty_pixels(monkeypatch, share, left_px, phrase):
    """A fit is hopeless above a fifth of the motion or 50 px; the finding reports the one exceeded."""
    monkeypatch.setattr(module, "unexplained_motion", lambda problem, state: share)
    monkeypatch.setattr(module, "_residual_px", lambda problem, state: left_px)
    assert is_hopeless(None, None) == (phrase is not None)
    if phrase is not None:
        assert phrase in hopeless_finding(SimpleNamespace(open_clocks=frozenset(), robots=(), groups=[]), None).message


ARMS = Scenario(samples=16, joints=True, joint_offset_rad=np.radians(8.0))


@pytest.mark.journey
def test_joint_offsets_of_degrees_are_named():
    """The largest visible joint offset of each arm is named to a degree or two.

    The advised entry has a prior that covers it.
    """
    made = simulate(ARMS, 1)
    solution = solve(made.cell, made.recording)
    assert is_hopeless(solution.problem, solution.state)
    (found,) = joint_offset_findings(solution.problem, solution.state, STATED)
    assert (found.code, found.severity, found.about) == ("robot-model", "error", ("eye", "hand"))
    for robot in ("eye", "hand"):
        true = np.degrees(made.robots[robot].kind_values("joint_offsets"))
        words = found.what.partition(f" of {robot} by ")
        joint = int(words[0].rpartition("joint ")[2]) - 1
        assert 0 < joint < 5
        assert abs(float(words[2].split()[0]) - true[joint]) < 2
    assert "`joint_offsets: {status: prior, sigma_rad: 0." in found.do[0]


@pytest.mark.journey
def test_joint_offsets_do_not_explain_wrong_samples():
    """Joint offsets do not explain views of other samples; robots that record poses get no such finding."""
    for joints in (True, False):
        made = simulate(replace(ARMS, joints=joints, joint_offset_rad=0.0), 0)
        samples = made.recording.samples
        mixed = Recording(tuple(replace(s, observations=samples[-k].observations) for k, s in enumerate(samples)))
        problem, _ = build_problem(made.cell, mixed)
        state = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))
        assert is_hopeless(problem, state)
        assert joint_offset_findings(problem, state, STATED) == []
