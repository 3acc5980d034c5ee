"""Tests of `describe_gravity`: the wording of the assumed direction of gravity."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.phrases.gravity import describe_gravity
from basecal.geometry import SE3
from basecal.simulation.arms import six_axis

CELL = SimpleNamespace(reference="eye", base_name="eye_base_from_{}_base".format)
ON_THE_WALL = SE3.from_rpy([0, np.pi / 2, 0], np.ones(3))


def make_solution(problem, transforms):
    return SimpleNamespace(problem=problem, state=SimpleNamespace(transforms=transforms))


def describe(robots, base=ON_THE_WALL, hand_down=(0.0, 0.0, -1.0)):
    chain = six_axis()
    hand = replace(chain, masses=replace(chain.masses, down=np.array(hand_down)))
    problem = SimpleNamespace(chains={"eye": chain, "hand": hand, "light": replace(chain, masses=None)})
    return describe_gravity(CELL, make_solution(problem, {"eye_base_from_hand_base": base}), robots)


def test_equally_mounted_arms_do_not_contradict():
    """Arms with slightly tilted bases, or with consistent stated gravity, do not contradict each other."""
    assert describe(("eye",), SE3.from_rpy([0.1, 0, 2], np.ones(3))) == "Gravity is assumed along -z of eye_base."
    assert describe(("hand",), hand_down=(1, 0, 0)) == "Gravity is assumed along +x of hand_base."


@pytest.mark.parametrize("robots", [("eye",), ("eye", "hand")])
def test_wall_mounted_arm_is_reported(robots):
    """A wall-mounted arm is reported with the angle between the directions and the entry to write."""
    words = describe(robots)
    assert f"along {' and '.join(f'-z of {robot}_base' for robot in robots)}. In the answer" in words
    assert "differs by 90 deg" in words
    assert "deflection: {down: [x, y, z]}" in words


@pytest.mark.parametrize(("hand_down", "apart"), [((0, 0, -1), None), ((0, 0, 1), "180 deg")])
def test_directions_are_unit_vectors_to_rounding(hand_down, apart):
    """Products of unit vectors may exceed one by rounding. Equal directions agree, opposite ones differ by 180 deg."""
    words = describe(("hand",), SE3.identity(), np.array(hand_down) * (1 + 1e-10))
    assert (apart in words) if apart else words.endswith("of hand_base.")


def test_unknown_base_gives_no_angle():
    """An unknown base gives no angle; a direction along no axis is stated by its numbers."""
    chain = six_axis()
    tilted = replace(chain, masses=replace(chain.masses, down=np.array([0.6, 0, -0.8])))
    problem = SimpleNamespace(chains={"hand": tilted})
    words = describe_gravity(CELL, make_solution(problem, {}), ("hand",))
    assert words == "Gravity is assumed along (0.6, 0, -0.8) of hand_base."


@pytest.mark.parametrize(("tilt_deg", "is_reported"), [(9.9, False), (10.1, True)])
@pytest.mark.parametrize("others", [{}, {"third": SE3.identity()}])
def test_bases_may_differ_by_ten_degrees(tilt_deg, is_reported, others):
    """Bases may differ by ten degrees; the largest tilt between two arms with known bases counts."""
    chain = six_axis()
    problem = SimpleNamespace(chains={"eye": chain, "hand": chain, "third": chain, "open": chain})
    tilted = SE3.from_rpy(np.radians([tilt_deg, 0, 0]), np.ones(3))
    bases = {CELL.base_name(name): base for name, base in {"hand": tilted, **others}.items()}
    words = describe_gravity(CELL, make_solution(problem, bases), ("eye",))
    assert ("differs by 10 deg" in words) == is_reported


def test_opposite_tilts_add_up():
    """The tilts of two arms that lean away from each other add up."""
    chain = six_axis()
    problem = SimpleNamespace(chains={"eye": chain, "hand": chain, "third": chain})
    bases = {
        CELL.base_name(name): SE3.from_rpy(np.radians([tilt, 0, 0]), np.ones(3))
        for name, tilt in (("hand", 8.0), ("third", -7.0))
    }
    assert "differs by 15 deg" in describe_gravity(CELL, make_solution(problem, bases), ("eye",))
