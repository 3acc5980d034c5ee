"""Tests of groups of views and their two ends."""

from __future__ import annotations

import numpy as np
import pytest
from tests.ends import end, views, with_hand

from basecal.geometry import SE3

RNG = np.random.default_rng(5)
PLACES = {name: SE3.exp(RNG.standard_normal(6)) for name in ("eye base", "hand base")}


def group_of(eye_base=None, hand_base="hand base"):
    """Three views of two arms whose bases have these names."""
    poses = [SE3.exp(RNG.standard_normal((3, 6))) for _ in range(2)]
    eye = end("eye", poses[0], mount="camera mount", base=eye_base, stop=[0, 1, 1], stop_number=[0, 1, 1])
    return views(eye, end("hand", poses[1], mount="target mount", base=hand_base, stop_number=[4, 3, 2]))


def test_robots_and_frames_of_both_ends():
    """A base without a name is the reference's, and the world is no robot."""
    group = group_of()
    assert group.robots == ("eye", "hand")
    assert group.frames == ("camera mount", "target mount", "hand base")
    assert (group.robot_end("hand"), group.robot_end("third")) == (group.hand, None)
    assert with_hand(group, robot=None, base=None).robots == ("eye",)


def test_relation_of_two_bases():
    """The relation is the product of both base poses, and a base without a name is in the world."""
    related = group_of("eye base").eye_base_from_hand_base(PLACES)
    np.testing.assert_allclose((PLACES["eye base"] @ related).matrix, PLACES["hand base"].matrix, atol=1e-12)
    assert group_of(None, None).eye_base_from_hand_base(PLACES).matrix.tolist() == np.eye(4).tolist()
    np.testing.assert_allclose(group_of().eye_base_from_hand_base(PLACES).matrix, PLACES["hand base"].matrix)


@pytest.mark.parametrize("names", [("eye base", "hand base"), (None, "hand base"), ("eye base", None)])
@pytest.mark.parametrize("free", [{"hand base"}, {"eye base"}, {"eye base", "hand base"}])
def test_relation_places_the_free_base(names, free):
    """The hand's base is placed, or else the eye's, to satisfy the relation. If neither is free, none is."""
    group, related = group_of(*names), SE3.exp(RNG.standard_normal(6))
    placed = group.placed_base(related, PLACES, free)
    open_bases = [name for name in (names[1], names[0]) if name in free]
    assert list(placed) == open_bases[:1]
    if placed:
        np.testing.assert_allclose(group.eye_base_from_hand_base(PLACES | placed).matrix, related.matrix, atol=1e-12)


def test_close_loop_is_the_product_of_both_ends():
    """The loop has all factors from the camera round to the target."""
    group, (x, y, z) = group_of(), SE3.exp(RNG.standard_normal((3, 6)))
    for k, closed in enumerate(group.close_loop(x, y, z)):
        a, c = group.eye.base_from_flange[k], group.hand.base_from_flange[k]
        np.testing.assert_allclose((a @ x @ closed).matrix, (y @ c @ z).matrix, atol=1e-12)


def test_without_stops_makes_robots_exact():
    """The stop numbers of the recording are kept."""
    exact = group_of().without_stops()
    assert [of.stop.tolist() for of in exact.ends] == [[-1] * 3] * 2
    assert [of.stop_number.tolist() for of in exact.ends] == [[0, 1, 1], [4, 3, 2]]
    assert not exact.eye.has_noise
