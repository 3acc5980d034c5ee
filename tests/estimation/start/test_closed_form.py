"""The closed forms on data without noise."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.start.closed_form import Loop, solve_rotations, solve_translations
from basecal.geometry import SE3

PATTERNS = ["x", "y", "z", "xy", "xz", "yz", "xyz"]


def poses(rng: np.random.Generator, n: int, still: bool = False) -> SE3:
    xi = rng.standard_normal((n, 6))
    return SE3.exp(np.broadcast_to(xi[0], xi.shape) if still else xi)


def loop_of(unknown: str, n: int, eye_still: bool = False, hand_still: bool = False) -> tuple[Loop, dict[str, SE3]]:
    rng = np.random.default_rng(5)
    a, c = poses(rng, n, eye_still), poses(rng, n, hand_still)
    truth = {name: SE3.exp(rng.standard_normal(6)) for name in "xyz"}
    b = (a @ truth["x"]).inverse() @ truth["y"] @ c @ truth["z"]
    known = {name: None if name in unknown else value for name, value in truth.items()}
    return Loop(a, b, c, known["x"], known["y"], known["z"], np.ones(n)), truth


@pytest.mark.parametrize("unknown", PATTERNS)
def test_exact_data_give_exact_transforms(unknown):
    """Whatever of X, Y and Z is unknown comes out to 1e-9, and counts as determined."""
    loop, truth = loop_of(unknown, 20)
    found = solve_rotations(loop)
    assert found.clear
    for name, ours in zip("xyz", solve_translations(loop, found), strict=True):
        assert np.abs((ours.inverse() @ truth[name]).log()).max() < 1e-9


@pytest.mark.parametrize("unknown", ["xy", "xyz"])
def test_an_arm_that_stands_still_is_not_enough(unknown):
    """With the hand still, Y and Z (or all three) cannot be told apart: the gate stays closed."""
    loop, _ = loop_of("yz" if unknown == "xy" else unknown, 20, hand_still=True)
    assert not solve_rotations(loop).clear
    mirrored, _ = loop_of(unknown, 20, eye_still=True)
    assert not solve_rotations(mirrored).clear


def test_too_few_samples_are_not_enough():
    """Three samples leave all three rotations open."""
    loop, _ = loop_of("xyz", 3)
    assert not solve_rotations(loop).clear
