"""Tests of clock offsets of cameras and robots, which move views by the robots' velocities."""

from __future__ import annotations

import numpy as np

from basecal.effects.clock_offset import candidates as clock_offsets
from made_views import Made


def test_cameras_and_robots_on_paths_have_clock_offsets():
    """A camera is late relative to all arms that carry it or its targets, a robot relative to the other robots."""
    speeds = {name: np.random.default_rng(1).standard_normal((8, 6)) for name in ("eye", "hand")}
    of = Made(8, {"eye": "eye"}, {"camera": "other"}, robots=("eye", "hand"), speeds=speeds)
    found = {each.about[0]: each for each in clock_offsets(of)}
    eye, hand = (
        [(of.flange_jacobian(k, name) @ speeds[name][..., None])[:, None] for k in range(2)] for name in ("eye", "hand")
    )
    assert list(found) == ["other", "wrist", "eye", "hand"]
    wanted = {"wrist": (eye[0] + hand[0], None), "other": (None, hand[1]), "eye": (eye[0], None), "hand": tuple(hand)}
    for name, moves in wanted.items():
        assert (found[name].code, found[name].unit) == ("clock-offset", "s")
        for one, other in zip(found[name].moves, moves, strict=True):
            assert (one is None) == (other is None)
            assert one is None or np.allclose(one, other, atol=1e-12)
    of.has_times = False
    assert {each.unit for each in clock_offsets(of)} == {"samples"}
    of.estimated_effects = {"wrist": {"clock_offset"}, "hand": {"clock_offset"}}
    assert [each.about[0] for each in clock_offsets(of)] == ["other", "eye"]


def test_single_moving_robot_has_no_own_clock():
    """The delay of a single robot equals all cameras being early; without a path no clock is observable."""
    of = Made(8, {"eye": "eye"}, {"camera": "still", "hand": None}, robots=("eye", "hand"))
    assert [each.about[0] for each in clock_offsets(of)] == ["wrist"]
    of.speeds = {}
    assert list(clock_offsets(of)) == []
