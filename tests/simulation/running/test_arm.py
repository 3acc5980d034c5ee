"""An arm in time, and what is wrong with it."""

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
STILL_M = 3e-4  # what stops differ by where nothing is wrong: ten times the repeatability at a reach of a metre


def arm(*faults, seed=0):
    return RunningArm("eye", Kinematics(ur5e(), {}), HOME, read_faults(faults), seed)


def away_m(one, joints, now):
    """How far its flange is from where these joints have it [m]."""
    return float(np.linalg.norm(one.base_from_flange(now).translation - ur5e().forward(joints).translation))


def test_it_goes_from_rest_to_rest_within_its_speed():
    """The way is smooth, no joint is faster than asked, and the end is reached; then it stays."""
    one = arm()
    one.move(THERE, 0.5, 1.0)
    times = np.linspace(1.0, 4.0, 3001)
    way = np.stack([one.commanded_joints(t) for t in times])
    speed = np.abs(np.gradient(way, times, axis=0))
    assert 0.45 < speed.max() <= 0.5 + 1e-6
    assert speed[0].max() < 1e-3
    np.testing.assert_array_equal(way[-1], THERE)
    assert away_m(one, THERE, 4.0) < STILL_M


def test_it_stops_on_the_way():
    """After a stop it rests between start and goal within a fifth of a second, and can be sent on."""
    one = arm()
    one.move(THERE, 0.5, 0.0)
    one.stop(0.6)
    rest = one.commanded_joints(0.8)
    np.testing.assert_array_equal(rest, one.commanded_joints(10.0))
    assert 0 < rest[0] - HOME[0] < 0.4
    one.move(THERE, 0.5, 10.0)
    np.testing.assert_array_equal(one.commanded_joints(20.0), THERE)


def test_the_same_place_has_the_same_error():
    """It stands elsewhere than sent by some hundredths of a millimetre, by the same whenever it is sent there."""
    one, again = arm(), arm()
    one.move(THERE, 1.0, 0.0)
    again.move(HOME + 0.1, 1.0, 0.0)
    again.move(THERE, 1.0, 10.0)
    assert 0 < away_m(one, THERE, 20.0) < STILL_M
    np.testing.assert_array_equal(one.base_from_flange(20.0).matrix, again.base_from_flange(20.0).matrix)


def test_backlash_depends_on_the_side_it_comes_from():
    """From both sides the flange comes to rest in two places, apart by the play of the joint that moved."""
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
    """The flange swings by millimetres after it arrives, less and less, until it rests; encoders see nothing."""
    one = arm("ringing=5")
    one.move(THERE, 1.0, 0.0)
    arrival = next(t for t in np.arange(0, 5, 1e-3) if np.array_equal(one.commanded_joints(t), THERE))
    swings = [away_m(one, THERE, arrival + t) for t in np.linspace(0.002, 0.49, 200)]
    assert max(swings) > 2e-3
    assert max(swings[100:]) < 0.6 * max(swings)
    assert max(swings[-10:]) < 0.1 * max(swings)
    assert away_m(one, THERE, arrival + 0.501) < STILL_M
    assert np.array_equal(one.reported_joints(arrival + 0.01), THERE)


def test_joints_stray_on_their_way_and_arrive():
    """By another amount each, most in the middle, of which encoders see nothing."""
    one, exact = arm("following-error=0.1"), arm()
    for each in (one, exact):
        each.move(THERE, 1.0, 0.0)
    apart = [away_m(one, exact.commanded_joints(t), t) for t in (0.0, 0.5 * one.arrival_s, one.arrival_s)]
    assert apart[1] > 5e-4
    assert max(apart[0], apart[2]) < STILL_M
    assert np.array_equal(one.reported_joints(0.3), exact.reported_joints(0.3))


def test_encoders_are_noisy():
    """States scatter by the size of the noise, and the flange does not."""
    one = arm("encoder-noise=0.1")
    one.move(THERE, 1.0, 0.0)
    states = np.stack([one.reported_joints(10.0 + t) for t in range(400)])
    assert np.std(states - THERE) == pytest.approx(np.radians(0.1), rel=0.06)  # 2400 draws: 1.4 %, four sigmas
    assert away_m(one, THERE, 10.0) < STILL_M


@pytest.mark.parametrize(("joints", "speed"), [(np.zeros(5), 1.0), (np.full(6, 4.0), 1.0), (HOME, 0.0)])
def test_what_it_cannot_do(joints, speed):
    """Too few joints, joints beyond their limits and no speed are refused, and it stays where it is."""
    one = arm()
    with pytest.raises(InputError):
        one.move(joints, speed, 0.0)
    assert one.moves == 0


@pytest.mark.parametrize(("way", "speed", "peak_speed"), [(3.0, 10.0, np.pi), (0.4, 0.5, 0.5)])
def test_no_joint_is_faster_than_it_can_be(way, speed, peak_speed):
    """Nor than asked; the duration follows."""
    one = arm()
    one.move(HOME - np.array([way, 0, 0, 0, 0, 0]), speed, 1.0)
    middle = 1.0 + (one.arrival_s - 1.0) / 2
    apart = one.commanded_joints(middle + 1e-4)[0] - one.commanded_joints(middle - 1e-4)[0]
    assert apart / 2e-4 == pytest.approx(-peak_speed, rel=1e-4)
    assert one.goal[0] == HOME[0] - way


def test_short_ways_are_limited_by_acceleration():
    """Eight rad/s^2 at most, at a fifth of the way."""
    one = arm()
    one.move(HOME + 0.01, 3.0, 0.0)
    times = np.linspace(0, one.arrival_s, 400)
    way = np.array([one.commanded_joints(t)[0] for t in times])
    acceleration = np.gradient(np.gradient(way, times), times)[2:-2]
    assert np.abs(acceleration).max() == pytest.approx(8.0, rel=0.01)


def test_a_share_of_the_way_is_smooth():
    """Zero before, half in the middle, one after; of a way without duration all."""
    leg = Leg(2.0, 4.0, HOME, THERE, np.ones(6), np.zeros(6), np.zeros(6))
    shares = [leg.share(t) for t in (0.0, 2.0, 3.0, 4.0, 5.0, 6.0, 9.0)]
    assert shares == pytest.approx([0, 0, 0.103515625, 0.5, 0.896484375, 1, 1])
    assert Leg(2.0, 0.0, HOME, HOME, np.ones(6), np.zeros(6), np.zeros(6)).share(1.0) == 1


def test_a_joint_that_stays_keeps_its_side_and_its_error_changes_on_the_way():
    """Sides of joints that move are those of their direction."""
    goal = HOME + np.array([0.1, -0.1, 0, 1e-10, 0, 0])
    before = np.array([-1.0, 1, -1, 1, 1, -1])
    leg = Leg(0.0, 1.0, HOME, goal, before, np.zeros(6), np.ones(6))
    assert leg.side.tolist() == [1, -1, -1, 1, 1, -1]
    side, error = leg.rest(0.25)
    assert side.tolist() == [-0.5, 0.5, -1, 1, 1, -1]
    assert error.tolist() == [0.25] * 6


def test_a_stop_after_the_arrival_changes_nothing():
    """Before it the arm comes to rest 0.15 s later, where it would have been in half of that time."""
    one, other = arm(), arm()
    for each in (one, other):
        each.move(THERE, 0.5, 0.0)
    end = one.arrival_s
    one.stop(end + 0.1)
    assert (one.arrival_s, one.moves) == (end, 1)
    other.stop(0.6)
    assert other.arrival_s == pytest.approx(0.75)
    np.testing.assert_allclose(other.goal, one.commanded_joints(0.675))


def test_positioning_errors_are_those_of_an_industrial_arm():
    """Of 600 joints 3e-5 rad rms, to a tenth."""
    errors = [arm()._positioning_error(HOME + 0.01 * k) for k in range(100)]
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(3e-5, rel=0.1)


def test_joints_may_go_to_their_limits():
    """Not beyond."""
    one = arm()
    one.move(one.chain.upper, 1.0, 0.0)
    one.move(one.chain.lower, 1.0, 100.0)
    assert one.moves == 2
    with pytest.raises(InputError, match="within"):
        one.move(one.chain.upper + 1e-6, 1.0, 200.0)


def test_straying_is_largest_halfway():
    """By 4 s (1 - s) of its size there."""
    one, exact = arm("following-error=0.1"), arm()
    for each in (one, exact):
        each.move(THERE, 1.0, 0.0)
    times = np.array([0.3, 0.5]) * one.arrival_s
    quarter, half = (one._true_joints(t) - exact._true_joints(t) for t in times)
    share = one._leg.share(times[0])
    np.testing.assert_allclose(quarter, 4 * share * (1 - share) * half)
    assert 0.3 < np.sqrt(np.mean(half**2)) / np.radians(0.1) < 2


def test_ringing_has_nine_periods_a_second():
    """It begins with its size, crosses zero after a 36th of a second, and decays linearly."""
    one, exact = arm("ringing=5"), arm()
    for each in (one, exact):
        each.move(THERE, 1.0, 0.0)
    swing = [(one._true_joints(one.arrival_s + t) - exact._true_joints(10.0))[0] for t in (1e-9, 1 / 36, 1 / 18, 1 / 9)]
    np.testing.assert_allclose(np.array(swing[1:]) / swing[0], [0, -(1 - 1 / 9), 1 - 2 / 9], atol=1e-6)
    np.testing.assert_array_equal(one._true_joints(one.arrival_s - 0.01), exact._true_joints(exact.arrival_s - 0.01))
    at_home = arm("ringing=5")
    np.testing.assert_array_equal(at_home._true_joints(0.1), arm()._true_joints(0.1))
