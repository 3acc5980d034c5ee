"""Tests of the latency between the arms' motion and its image."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.acquisition.driver import Reading
from basecal.acquisition.images import latency as module
from basecal.acquisition.images.latency import ArmMotion, estimate_latency
from basecal.cell import RobotState

SPANS = np.array([[1.0, 1.6], [2.2, 2.9]])


def images(lag_s, spans=SPANS, hz=30.0, end_s=8.0):
    """Arrivals of images with a given latency, and whether each differs from the previous one."""
    at = np.arange(1.0, end_s, 1 / hz)
    moves = ((at[:, None] - lag_s >= spans[:, 0]) & (at[:, None] - lag_s <= spans[:, 1])).any(-1)
    return np.column_stack([at, moves])


@pytest.mark.parametrize("lag_s", [0.02, 0.1, 0.35, 1.0, 2.5])
def test_latency_is_between_its_bounds(lag_s):
    """A constant latency is found within one or two images to either side."""
    found = estimate_latency(SPANS, images(lag_s))
    assert found.low_s <= lag_s <= found.high_s
    assert found.high_s - found.low_s < 4 / 30


@pytest.mark.parametrize(("begin_s", "end_s"), [(0.05, 0.0), (0.0, 0.05), (-0.05, 0.2), (0.05, -0.05)])
def test_unseen_motion_widens_the_bounds(begin_s, end_s):
    """Slow starts and ends that images miss, or swings that joints miss, never make the upper bound too small."""
    seen = SPANS + np.array([begin_s, end_s])
    assert estimate_latency(SPANS, images(0.3, seen)).high_s >= 0.3


def test_repeated_images_are_one_motion():
    """A camera that repeats each image shows a motion in every second one."""
    shown = images(0.3, hz=60.0)
    shown[::2, 1] = 0
    assert estimate_latency(SPANS, shown).high_s == pytest.approx(0.3, abs=0.06)


def test_other_motions_yield_no_latency():
    """A person who walks by, an image without motion, and an unfinished motion yield none."""
    shown = images(0.3)
    assert estimate_latency(SPANS, np.column_stack([shown[:, 0], np.ones(len(shown))])) is None
    assert estimate_latency(SPANS, np.column_stack([shown[:, 0], shown[:, 0] > 7.0])) is None
    assert estimate_latency(SPANS, np.column_stack([shown[:, 0], np.zeros(len(shown))])) is None
    assert estimate_latency(SPANS, images(0.3, end_s=1.7)) is None


def test_long_pause_separates_two_motions(monkeypatch):
    """States closer than 2 mrad are rest; a short pause is part of a motion, a long one ends it."""
    now = [0.0]
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    arms, at = ArmMotion(), 0.0
    for when, step in ((0.0, 0.0), (1.0, 1e-3), (2.0, 0.01), (2.1, 0.01), (2.3, 0.01), (3.0, 0.01)):
        now[0], at = when, at + step
        arms.note("eye", Reading(when, RobotState(joints_rad=np.array([0.0, at]))))
    assert arms.spans == ((2.0, 2.3), (3.0, 3.0))
    arms.forget()
    assert arms.spans == ()


def test_latency_is_printed_with_its_uncertainty():
    """The uncertainty is half of its range."""
    assert str(module.Latency(0.1, 0.2)) == "0.15 +- 0.05 s"


@pytest.mark.parametrize(("count", "is_known"), [(2, False), (3, True), (4, True)])
def test_motion_needs_three_images(count, is_known):
    """Fewer may be noise; the motion must have ended in the last two."""
    at = np.arange(1.0, 3.0, 0.1)
    shown = np.column_stack([at, (at > 1.25) & (at < 1.25 + 0.1 * count)]).astype(float)
    spans = np.array([[1.0, 1.0 + 0.1 * (count - 1)]])
    assert (estimate_latency(spans, shown) is not None) == is_known
    for place in (-1, -2):
        going = shown.copy()
        going[place, 1] = 1
        assert estimate_latency(spans, going) is None


def test_motion_is_measured_from_the_last_moving_state():
    """Small steps add up in either direction; the first place of an arm is no motion."""
    motion = ArmMotion()
    for place, moves in ((5.0, False), (5.0015, False), (5.003, True), (5.002, False), (5.0009, True)):
        before = motion.spans
        motion.note("eye", Reading(0.0, RobotState(joints_rad=np.array([1.0, place]))))
        assert (motion.spans != before) == moves
    motion.note("hand", Reading(0.0, RobotState(joints_rad=np.array([-7.0]))))
    assert len(motion.spans) == 1
    motion.forget()
    assert motion.spans == ()
