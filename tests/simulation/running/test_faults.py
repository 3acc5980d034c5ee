"""Tests of the faults of a running cell as they are switched on."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.simulation.running.faults import FAULTS, Fault, Faults, read_faults
from basecal.simulation.running.plant import Clock, Plant
from shared.facing_arms import facing_arms


def test_fault_sizes_have_units_and_defaults():
    """A size is in the unit of its fault, a missing size is the default, and an inactive fault has size zero."""
    faults = read_faults(["joint-offsets=1", "sag", "base-bumped=3@7"])
    assert faults.size("joint-offsets") == pytest.approx(np.radians(1))
    assert faults.size("sag") == pytest.approx(np.radians(FAULTS["sag"].default_size))
    assert (faults.size("base-bumped"), faults.delay_moves("base-bumped")) == (pytest.approx(0.003), 7)
    assert faults.size("backlash") == 0


def test_every_fault_has_a_default_size():
    """Each fault has a positive default size, which its name alone selects."""
    faults = read_faults(list(FAULTS))
    assert all(faults.size(name) == kind.default_size * kind.scale > 0 for name, kind in FAULTS.items())


@pytest.mark.parametrize(
    ("written", "message"),
    [
        (["joint-offset"], "did you mean 'joint-offsets'"),
        (["sag=much"], r"expected sag, sag=SIZE \[deg\]"),
        (["sag=-1"], "size above 0"),
        (["sag=nan"], "size above 0"),
        (["sag=1@3"], "acts from the start"),
        (["base-bumped=1@-3"], "moves of 0 or more"),
        (["sag", "sag=1"], "given twice"),
    ],
)
def test_invalid_fault_is_refused(written, message):
    """The error is one line that states the expected form."""
    with pytest.raises(InputError, match=message):
        read_faults(written)


@cache
def answers(*faults: str) -> list[np.ndarray]:
    """States, poses, a stamp and an image of a running cell while its arms move twice."""
    world = facing_arms("led", faults=read_faults(faults))
    running, found = Plant(world, Clock(0)), []
    for way in (0.05, -0.05):
        for name, joints in world.home.items():
            running.move(name, joints + way, 1.0)
        running.wait(0.05)
        shot = running.shot("wrist")
        found += [np.array(shot.stamp_s), shot.image]
        for _ in range(15):
            running.wait(0.05)
            seen = running.camera_scene("wrist")
            found += [seen.camera_from_target.matrix, seen.reflected, *(running.state(arm)[1] for arm in world.home)]
    return found


@pytest.mark.journey
@pytest.mark.parametrize("name", FAULTS)
def test_every_fault_has_an_effect(name):
    """A cell with four times the default size answers differently from an intact one.

    The simulator thus ignores no fault.
    """
    fault = f"{name}={4 * FAULTS[name].default_size}{'@1' if FAULTS[name].is_sudden else ''}"
    pairs = zip(answers(fault), answers(), strict=True)
    acts = not all(np.array_equal(wrong, right) for wrong, right in pairs)
    assert acts, (
        f"the simulator passes {name} over: apply faults.size({name!r}) in simulation/running, such as in arm.py"
    )


def test_sudden_faults_act_after_twelve_moves():
    """Another number may be stated, zero included. Other faults act from the start."""
    for written, moves in (("base-bumped", 12), ("base-bumped=3", 12), ("base-bumped@1=", None), ("base-bumped=@1", 1),
                           ("base-bumped=3@0", 0), ("sag=1", 0), ("sag=1@0", 0)):  # fmt: skip
        if moves is None:
            with pytest.raises(InputError, match="no fault"):
                read_faults([written])
        else:
            assert read_faults([written]).delay_moves(written.partition("=")[0]) == moves
    assert read_faults([]).delay_moves("base-bumped") == 0


@pytest.mark.parametrize("size", ["0", "inf", "-0.0"])
def test_fault_sizes_must_be_positive_and_finite(size):
    with pytest.raises(InputError, match="size above 0"):
        read_faults([f"sag={size}"])
    assert read_faults(["sag=1e-9"]).size("sag") > 0


def test_fault_acts_from_start_by_default():
    """Sizes of the same name add up; no faults have size zero."""
    faults = Faults((Fault("base-bumped", 0.003), Fault("base-bumped", 0.001, 4)))
    assert (faults.delay_moves("base-bumped"), faults.size("base-bumped")) == (0, 0.004)
    assert Faults().size("base-bumped") == 0
