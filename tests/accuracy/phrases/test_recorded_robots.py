"""Advice on robots by what was recorded of them."""

from __future__ import annotations

from basecal.accuracy.phrases.recorded_robots import advise_check


def test_joints_have_no_poses_to_check():
    """Of robots that recorded joints the URDF and the joints are named, else poses are."""
    assert "URDF of eye and hand" in advise_check(("eye", "hand"))
    assert "base_from_flange" not in advise_check(("eye",))
    assert "base_from_flange" in advise_check(())
