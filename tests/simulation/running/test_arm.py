"""Tests of a running arm over time, with its faults."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.simulation.running.arm import Leg, RunningArm
from basecal.simulation.running.faults import read_faults
from basecal.simulation.running.ur5e import ur5e

HOME = np.array([0.3, -1.3, -1.8, -3.0, -1.2, 3.0])
THERE = HOME + np.array([0.4, 0, 0.2, -0.3, 0, 0])
STILL_M = 3e-4  # largest difference of stops without faults: ten times the repeatability at a reach of a metre


def arm(*faults, seed=0):
    return RunningArm("eye", Kinematics(ur5e(), {}), HOME, read_faults(faults), seed)


def away_m(one, joints, now):
    """Distance of the flange from its pose at given joints [m]."""
    return float(np.linalg.norm(one.base_from_flange(now).translation - ur5e().forward(joints).translation))


def test_move_is_smooth_and_within_speed():
    """The path is smooth from rest to rest, no joint exceeds the requested speed, and the arm stays at its end."""
    one = arm()
    one.move(THERE, 0.5, 1.0)
    times = np.linspace(1.0, 4.0, 3001)
    way = np.stack([one.commanded_joints(t) for t in times])
    speed = np.abs(np.gradient(way, times, axis=0))
    assert 0.45 < speed.max() <= 0.5 + 1e-6
    assert speed[0].max() < 1e-3
    np.testing.assert_array_equal(way[-1], THERE)
    assert away_m(one, THERE, 4.0) < STILL_M


def test_stop_halts_the_arm_on_its_path():
    """After a stop the arm is at rest between start and goal within a fifth of a second, and can be sent on."""
    one = arm()
    one.move(THERE, 0.5, 0.0)
    one.stop(0.6)
    rest = one.commanded_joints(0.8)
    np.testing.assert_array_equal(rest, one.commanded_joints(10.0))
    assert 0 < rest[0] - HOME[0] < 0.4
    one.move(THERE, 0.5, 10.0)
    np.testing.assert_array_equal(one.commanded_joints(20.0), THERE)


def test_positioning_error_is_repeatable():
    """The pose differs from the goal by some hundredths of a millimetre, identically for every move to it."""
    one, again = arm(), arm()
    one.move(THERE, 1.0, 0.0)
    again.move(HOME + 0.1, 1.0, 0.0)
    again.move(THERE, 1.0, 10.0)
    assert 0 < away_m(one, THERE, 20.0) < STILL_M
    np.testing.assert_array_equal(one.base_from_flange(20.0).matrix, again.base_from_flange(20.0).matrix)


def test_backlash_depends_on_direction():
    """The flange comes to rest at two poses from both directions, apart by the play of the joint that moved."""
    play = np.radians(0.5)
    one = arm("backlash=0.5")
    rests = []
    for way in (-0.3, 0.3):
        one.move(HOME + np.array([way, 0, 0, 0, 0, 0]), 1.0, 0.0)
        one.move(HOME, 1.0, 10.0)
        rests.append(one.base_from_flange(20.0))
    turned = np.linalg.norm((rests[0].inverse() @ rests[1]).rotvec)
    assert turned == pytest.approx(play, rel=0.02)


def test_ringing_ends_after_half_a_second():
    """The flange oscillates by millimetres after its arrival, with decreasing amplitude until it rests.

    Encoders do not measure it.
    """
    one = arm("ringing=5")
    one.move(THERE, 1.0, 0.0)
    arrival = next(t for t in np.arange(0, 5, 1e-3) if np.array_equal(one.commanded_joints(t), THERE))
    swings = [away_m(one, THERE, arrival + t) for t in np.linspace(0.002, 0.49, 200)]
    assert max(swings) > 2e-3
    assert max(swings[100:]) < 0.6 * max(swings)
    assert max(swings[-10:]) < 0.1 * max(swings)
    assert away_m(one, THERE, arrival + 0.501) < STILL_M
    assert np.array_equal(one.reported_joints(arrival + 0.01), THERE)


def test_following_error_vanishes_at_arrival():
    """Each joint has its own following error, largest in the middle of the path, which encoders do not measure."""
    one, exact = arm("following-error=0.1"), arm()
    for each in (one, exact):
        each.move(THERE, 1.0, 0.0)
    apart = [away_m(one, exact.commanded_joints(t), t) for t in (0.0, 0.5 * one.arrival_s, one.arrival_s)]
    assert apart[1] > 5e-4
    assert max(apart[0], apart[2]) < STILL_M
    assert np.array_equal(one.reported_joints(0.3), exact.reported_joints(0.3))


def test_encoder_noise_affects_only_states():
    """States scatter with the sigma of the noise, and the flange does not."""
    one = arm("encoder-noise=0.1")
    one.move(THERE, 1.0, 0.0)
    states = np.stack([one.reported_joints(10.0 + t) for t in range(400)])
    assert np.std(states - THERE) == pytest.approx(np.radians(0.1), rel=0.06)  # 2400 draws: 1.4 %, four sigmas
    assert away_m(one, THERE, 10.0) < STILL_M


@pytest.mark.parametrize(("joints", "speed"), [(np.zeros(5), 1.0), (np.full(6, 4.0), 1.0), (HOME, 0.0)])
def test_impossible_moves_are_refused(joints, speed):
    """Too few joints, joints beyond their limits and a speed of zero are refused, and the arm stays."""
    one = arm()
    with pytest.raises(InputError):
        one.move(joints, speed, 0.0)
    assert one.moves == 0


@pytest.mark.parametrize(("way", "speed", "peak_speed"), [(3.0, 10.0, np.pi), (0.4, 0.5, 0.5)])
def test_speed_is_limited(way, speed, peak_speed):
    """No joint exceeds its maximal or the requested speed; the duration follows."""
    one = arm()
    one.move(HOME - np.array([way, 0, 0, 0, 0, 0]), speed, 1.0)
    middle = 1.0 + (one.arrival_s - 1.0) / 2
    apart = one.commanded_joints(middle + 1e-4)[0] - one.commanded_joints(middle - 1e-4)[0]
    assert apart / 2e-4 == pytest.approx(-peak_speed, rel=1e-4)
    assert one.goal[0] == HOME[0] - way


def test_short_moves_are_limited_by_acceleration():
    """The acceleration is at most eight rad/s^2, at a fifth of the path."""
    one = arm()
    one.move(HOME + 0.01, 3.0, 0.0)
    times = np.linspace(0, one.arrival_s, 400)
    way = np.array([one.commanded_joints(t)[0] for t in times])
    acceleration = np.gradient(np.gradient(way, times), times)[2:-2]
    assert np.abs(acceleration).max() == pytest.approx(8.0, rel=0.01)


def test_path_share_is_smooth():
    """The share is zero before the path, half in the middle and one after it.

    A path without duration has a share of one.
    """
    leg = Leg(2.0, 4.0, HOME, THERE, np.ones(6), np.zeros(6), np.zeros(6))
    shares = [leg.share(t) for t in (0.0, 2.0, 3.0, 4.0, 5.0, 6.0, 9.0)]
    assert shares == pytest.approx([0, 0, 0.103515625, 0.5, 0.896484375, 1, 1])
    assert Leg(2.0, 0.0, HOME, HOME, np.ones(6), np.zeros(6), np.zeros(6)).share(1.0) == 1


def test_backlash_side_follows_moving_joints():
    """The sides of moving joints are those of their directions; a still joint keeps its side.

    Positioning errors change along the path.
    """
    goal = HOME + np.array([0.1, -0.1, 0, 1e-10, 0, 0])
    before = np.array([-1.0, 1, -1, 1, 1, -1])
    leg = Leg(0.0, 1.0, HOME, goal, before, np.zeros(6), np.ones(6))
    assert leg.side.tolist() == [1, -1, -1, 1, 1, -1]
    side, error = leg.rest(0.25)
    assert side.tolist() == [-0.5, 0.5, -1, 1, 1, -1]
    assert error.tolist() == [0.25] * 6


def test_a_stop_after_the_arrival_changes_nothing():
    """Before its arrival a stopped arm comes to rest 0.15 s later, where it would have been in half of that time."""
    one, other = arm(), arm()
    for each in (one, other):
        each.move(THERE, 0.5, 0.0)
    end = one.arrival_s
    one.stop(end + 0.1)
    assert (one.arrival_s, one.moves) == (end, 1)
    other.stop(0.6)
    assert other.arrival_s == pytest.approx(0.75)
    np.testing.assert_allclose(other.goal, one.commanded_joints(0.675))


def test_positioning_error_is_realistic():
    """The positioning errors of 600 joints have 3e-5 rad rms, within a tenth, as industrial arms do."""
    errors = [arm()._positioning_error(HOME + 0.01 * k) for k in range(100)]
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(3e-5, rel=0.1)


def test_joints_may_move_to_their_limits():
    """A goal at the limits is accepted, and one beyond is refused."""
    one = arm()
    one.move(one.chain.upper, 1.0, 0.0)
    one.move(one.chain.lower, 1.0, 100.0)
    assert one.moves == 2
    with pytest.raises(InputError, match="within"):
        one.move(one.chain.upper + 1e-6, 1.0, 200.0)


def test_following_error_is_largest_halfway():
    """The following error is 4 s (1 - s) of its size at a share s of the path."""
    one, exact = arm("following-error=0.1"), arm()
    for each in (one, exact):
        each.move(THERE, 1.0, 0.0)
    times = np.array([0.3, 0.5]) * one.arrival_s
    quarter, half = (one._true_joints(t) - exact._true_joints(t) for t in times)
    share = one._leg.share(times[0])
    np.testing.assert_allclose(quarter, 4 * share * (1 - share) * half)
    assert 0.3 < np.sqrt(np.mean(half**2)) / np.radians(0.1) < 2


def test_ringing_has_nine_periods_per_second():
    """The oscillation begins with its size, crosses zero after a 36th of a second, and decays linearly."""
    one, exact = arm("ringing=5"), arm()
    for each in (one, exact):
        each.move(THERE, 1.0, 0.0)
    swing = [(one._true_joints(one.arrival_s + t) - exact._true_joints(10.0))[0] for t in (1e-9, 1 / 36, 1 / 18, 1 / 9)]
    np.testing.assert_allclose(np.array(swing[1:]) / swing[0], [0, -(1 - 1 / 9), 1 - 2 / 9], atol=1e-6)
    np.testing.assert_array_equal(one._true_joints(one.arrival_s - 0.01), exact._true_joints(exact.arrival_s - 0.01))
    at_home = arm("ringing=5")
    np.testing.assert_array_equal(at_home._true_joints(0.1), arm()._true_joints(0.1))
