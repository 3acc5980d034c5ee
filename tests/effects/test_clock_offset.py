"""Clocks of cameras and of robots move views with the robots' velocities."""

from __future__ import annotations

import numpy as np

from basecal.effects.clock_offset import candidates as clock_offsets
from made_views import Made


def test_clocks_are_those_of_cameras_and_of_robots_on_paths():
    """A camera is late against all arms that carry it or what it sees, a robot against the others."""
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


def test_a_single_robot_on_a_path_has_no_clock_of_its_own():
    """It is late as much as all cameras are early; without a path there is no clock to tell."""
    of = Made(8, {"eye": "eye"}, {"camera": "still", "hand": None}, robots=("eye", "hand"))
    assert [each.about[0] for each in clock_offsets(of)] == ["wrist"]
    of.speeds = {}
    assert list(clock_offsets(of)) == []
