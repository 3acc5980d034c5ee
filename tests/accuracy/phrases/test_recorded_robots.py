"""Tests of `advise_check`: advice by the recorded kind of robot states."""

from __future__ import annotations

from basecal.accuracy.phrases.recorded_robots import advise_check


def test_joint_robots_get_urdf_advice():
    """Robots with recorded joints are advised to check URDF and joints, others their poses."""
    assert "URDF of eye and hand" in advise_check(("eye", "hand"))
    assert "base_from_flange" not in advise_check(("eye",))
    assert "base_from_flange" in advise_check(())
