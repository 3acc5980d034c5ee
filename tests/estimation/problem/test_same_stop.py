"""Tests of grouping recorded poses into stops."""

import numpy as np
import pytest

from basecal.estimation.problem.same_stop import READ_BACK, _near_pairs, stop_numbers
from basecal.geometry import SE3

PLACES = SE3.exp(np.random.default_rng(0).uniform(-1, 1, (5, 6)))


def shifted_poses(steps_m):
    """One pose, shifted along an axis."""
    translation = np.zeros((len(steps_m), 3))
    translation[:, 1] = steps_m
    return SE3(np.repeat(np.eye(3)[None], len(steps_m), 0), translation)


def test_equal_poses_are_one_stop():
    """Numbers increase in the order in which places first appear."""
    order = [2, 2, 0, 4, 2, 0, 1]
    assert stop_numbers(PLACES[order], None, None).tolist() == [0, 0, 1, 2, 0, 1, 3]


@pytest.mark.parametrize(("off", "stops"), [(1.3e-4, [0, 0, 0]), (1.5e-4, [0, 1, 0])])
def test_readback_limit_of_stops(off, stops):
    """Consecutive poses are one stop within five sigmas of a difference of read-backs, 0.14 mm and mrad."""
    assert stop_numbers(shifted_poses([0, off, 0]), None, None).tolist() == stops
    turns = SE3.exp(np.array([[0.0] * 6, [0, 0, 0, 0, 0, off], [0.0] * 6]))
    assert stop_numbers(turns, None, None).tolist() == stops


def test_revisited_place_is_one_stop():
    """Places are revisited out of order, with read-backs of 20 um and urad. Places a millimetre apart stay separate."""
    rng = np.random.default_rng(1)
    visits = rng.permutation(np.tile(np.arange(8), 5))
    places = SE3.exp(np.concatenate([PLACES.log(), PLACES.log()[:3] + 1e-3]))[visits]
    numbers = stop_numbers(places @ SE3.exp(2e-5 * rng.standard_normal((40, 6))), None, None)
    assert len(set(numbers)) == 8
    assert all(len(set(numbers[visits == place])) == 1 for place in range(8))


def test_stated_noise_joins_consecutive_poses_only():
    """Among hundreds of places, some are within a large noise by chance."""
    assert stop_numbers(shifted_poses([0, 0.1, 4e-4]), None, np.full(6, 5e-4)).tolist() == [0, 1, 2]


def test_slow_path_has_many_stops():
    """Steps below the limit are not chained: a stop ends at the first pose too far from its start."""
    numbers = stop_numbers(shifted_poses(0.6 * READ_BACK * np.arange(9)), None, None)
    assert numbers.tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4]


def test_stated_noise_widens_the_limit():
    """Places nearer than the noise are one, however noisy the readings of one place are."""
    near = shifted_poses([0, 4e-4, 9e-4])
    assert stop_numbers(near, None, np.full(6, 5e-4)).tolist() == [0, 0, 1]
    assert stop_numbers(near, None, np.full(6, 1e-9)).tolist() == [0, 1, 2]


def test_other_joints_are_another_stop():
    """An arm that reaches one place in two ways has two errors."""
    joints = np.array([[0.1, 1.0], [0.1, 1.0], [0.1, -1.0]])
    assert stop_numbers(PLACES[[0, 0, 0]], joints, None).tolist() == [0, 0, 1]


@pytest.mark.parametrize("axis", range(6))
def test_smallest_noise_of_each_type_is_its_limit(axis):
    """The limit is the smallest noise of three axes each.

    One with half a millimetre or milliradian separates poses that the others would join.
    """
    noise = np.full(6, 1e-3)
    noise[axis] = 5e-4
    moved = shifted_poses([0, 8e-4])
    turned = SE3.exp(np.array([[0.0] * 6, [0, 0, 0, 0, 8e-4, 0]]))
    for poses, is_apart in ((moved, axis < 3), (turned, axis >= 3)):
        assert stop_numbers(poses, None, noise).tolist() == [0, int(is_apart)]


def test_distance_equal_to_the_limit_is_within():
    """The distance is half a metre at a noise of half a metre, both exact in binary."""
    assert stop_numbers(shifted_poses([0, 0.5, 0.25]), None, np.full(6, 0.5)).tolist() == [0, 0, 0]


def test_member_of_a_place_starts_no_other_place():
    """Four places in a row, each within the limit of the next, visited far apart in time, are two stops of two."""
    steps = READ_BACK * np.array([0, 90, 0.9, 90, 1.8, 90, 2.7])
    assert stop_numbers(shifted_poses(steps), None, None).tolist() == [0, 1, 0, 1, 2, 1, 2]


def test_near_pairs_are_near_in_every_coordinate():
    """Rows near only along the widest coordinate are no pair. The lower index is first."""
    places = np.array([[10.5, 5.0], [0.5, 5.0], [10.0, 5.5], [0.0, 0.0]])
    assert _near_pairs(places).tolist() == [[0, 2]]
