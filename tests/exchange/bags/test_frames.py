"""Tests of paths through the frames of tf."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.errors import FrameNotFound, InputError
from basecal.exchange.bags.frames import FrameTransform, Tree, compose_path, frame_hint, pose_from_values
from basecal.geometry import SE3

POSES = SE3.exp(np.random.default_rng(0).normal(0, 0.5, (4, 6)))


def values(pose: SE3) -> np.ndarray:
    return np.concatenate([pose.translation, pose.quaternion])


TREE = Tree(
    {
        "base": FrameTransform("world", values(POSES[0]), True, False),
        "wrist": FrameTransform("base", values(POSES[1]), False, True),
        "tool": FrameTransform("wrist", values(POSES[2]), True, False),
        "eye": FrameTransform("wrist", values(POSES[3]), True, False),
        "lost": FrameTransform("nowhere", values(POSES[3]), True, False),
    }
)


def test_path_between_branches_is_composed() -> None:
    """A path from one branch to another is the product of its transforms, some of them inverted."""
    found = compose_path(TREE, TREE.path("eye", "tool"), {}, "x")
    np.testing.assert_allclose(found.matrix, (POSES[3].inverse() @ POSES[2]).matrix, atol=1e-12)
    moved = SE3.exp(np.random.default_rng(1).normal(0, 0.5, (2, 6)))
    found = compose_path(TREE, TREE.path("world", "tool"), {"wrist": values_of_all(moved)}, "x")
    np.testing.assert_allclose(found.matrix, (POSES[0] @ moved @ POSES[2]).matrix, atol=1e-12)


def values_of_all(poses: SE3) -> np.ndarray:
    return np.concatenate([poses.translation, poses.quaternion], axis=1)


def test_rigid_ancestors_of_frame() -> None:
    """Ancestors lead up to the root, rigid ones up to the first moving frame.

    Unknown parents are listed in the hint.
    """
    assert TREE.ancestors("tool") == ["tool", "wrist", "base", "world"]
    assert TREE.rigid_ancestors("tool") == ["tool", "wrist"]
    assert "nowhere" in frame_hint(TREE)


def test_unconnected_frames_are_refused() -> None:
    """An unknown frame, and frames without a connection in tf, are errors."""
    with pytest.raises(FrameNotFound):
        TREE.path("base", "flange")
    with pytest.raises(InputError, match="no transform of tf joins 'base' and 'lost'"):
        TREE.path("base", "lost")


def test_cyclic_frames_terminate() -> None:
    """The ancestors of frames in a cycle end after one round."""
    both = {
        "a": FrameTransform("b", values(POSES[0]), True, True),
        "b": FrameTransform("a", values(POSES[0]), True, True),
    }
    assert Tree(both).ancestors("a") == ["a", "b"]


def test_invalid_transform_values_are_refused() -> None:
    """Non-finite numbers, and ones beyond any length, are refused before any computation."""
    for bad in (np.nan, np.inf, 1e200):
        with pytest.raises(InputError, match="x: not all numbers are finite"):
            pose_from_values(np.array([bad, 0, 0, 0, 0, 0, 1]), "x")
