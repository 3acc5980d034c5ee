"""Rare mix-ups are each undone by their hypothesis, and named where nothing usual explains the data."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.accuracy.input_check.rare_hypotheses import rare_hypotheses
from basecal.accuracy.input_check.rewriting import turned_round, with_robots
from basecal.accuracy.verdict import calibrate
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=20), 1)


def hypotheses(made, code):
    return [h for h in rare_hypotheses(made.cell, made.recording) if h.code == code]


def rotations(recording, robot="hand"):
    return np.stack([s.robots[robot].base_from_flange.rotation for s in recording.samples])


def read_as(recording, listed, read):
    """The hand's rotations listed in one way and read in another."""

    def of(poses):
        turned = Rotation.from_matrix(poses.rotation)
        numbers = turned.as_euler(listed) if listed else turned.as_rotvec()
        return SE3((Rotation.from_euler(read, numbers) if read else Rotation.from_rotvec(numbers)).as_matrix(),
                   poses.translation)  # fmt: skip

    return with_robots(recording, {"hand": of})


def test_how_many_there_are():
    """Of each stream the reverse order and shifts by 3 to 5 both ways; of each subset of arms 48 lists of angles."""
    assert Counter(h.code for h in rare_hypotheses(MADE.cell, MADE.recording)) == {
        "pairing-shifted": 3 * (1 + 6), "matrix-transposed": 3, "euler-order": 3 * (6 + 14 * 3),
    }  # fmt: skip
    poses = simulate(Scenario(samples=8, target="pose", layout="eye_in_hand"), 1)
    assert Counter(h.code for h in rare_hypotheses(poses.cell, poses.recording)) == {
        "pairing-shifted": 1, "matrix-transposed": 2, "euler-order": 2 * 48,
    }  # fmt: skip


@pytest.mark.parametrize(("listed", "read", "count"), [
    ("xyz", "XYZ", 1), ("XYZ", "xyz", 1), ("XYZ", "ZYX", 1), ("ZYX", "XYZ", 1), ("ZYX", "xyz", 2),
])  # fmt: skip
def test_angles_read_in_another_order_are_undone(listed, read, count):
    """By the hypothesis that says so, and where each order is the other one backwards by its twin as well."""
    mixed = read_as(MADE.recording, listed, read)
    back = [h for h in hypotheses(MADE, "euler-order") if h.about == ("hand",)]
    undone = [h for h in back if np.allclose(rotations(h.apply(MADE.cell, mixed)[1]), rotations(MADE.recording))]
    assert len(undone) == count
    assert all(each.fix.startswith("turn them into rotations as ") for each in undone)


@pytest.mark.parametrize(("listed", "read"), [("", "xyz"), ("", "XYZ"), ("ZYZ", "xyz"), ("xyz", "ZYZ")])
def test_numbers_beyond_a_quarter_turn_read_as_angles_are_undone(listed, read):
    """Of the two lists of angles that give a rotation either may be meant: each is the choice of a hypothesis."""
    mixed = read_as(MADE.recording, listed, read)
    true, right = rotations(MADE.recording), np.zeros(20, dtype=bool)
    for h in hypotheses(MADE, "euler-order"):
        if h.about == ("hand",):
            right |= np.all(np.isclose(rotations(h.apply(MADE.cell, mixed)[1]), true), axis=(1, 2))
    assert right.all()


def test_transposed_matrices_are_undone():
    """Rotations alone; the places stay."""
    mixed = with_robots(
        MADE.recording, {"hand": lambda poses: SE3(np.swapaxes(poses.rotation, -1, -2), poses.translation)}
    )
    (of_hand,) = (h for h in hypotheses(MADE, "matrix-transposed") if h.about == ("hand",))
    for now, then in zip(of_hand.apply(MADE.cell, mixed)[1].samples, MADE.recording.samples, strict=True):
        np.testing.assert_allclose(
            now.robots["hand"].base_from_flange.matrix, then.robots["hand"].base_from_flange.matrix, atol=1e-12
        )


@pytest.mark.parametrize(("mixed", "code", "words"), [
    (turned_round(MADE.recording, "hand"), "pairing-shifted", "what hand recorded stands in reverse order"),
    (read_as(MADE.recording, "xyz", "XYZ"), "euler-order", "angles about moving axes x, y, z (Staubli)"),
])  # fmt: skip
def test_calibrate_names_them(mixed, code, words):
    """Refused, by an error that says what is so; a clean recording knows nothing of it."""
    found = calibrate(MADE.cell, mixed)
    assert found.verdict == "refused"
    assert [f.code for f in found.findings if f.severity == "error"] == [code]
    assert words in found.findings[0].message
    assert calibrate(MADE.cell, MADE.recording).verdict == "good"


def test_a_hypothesis_leaves_others_alone():
    """What the eye recorded is as it was when the hand's order is turned round."""
    turned = turned_round(MADE.recording, "hand")
    np.testing.assert_array_equal(rotations(turned, "eye"), rotations(MADE.recording, "eye"))
    np.testing.assert_array_equal(rotations(turned), rotations(MADE.recording)[::-1])
    seen = turned_round(MADE.recording, None)
    assert seen.samples[0].observations == MADE.recording.samples[-1].observations
    np.testing.assert_array_equal(rotations(seen), rotations(MADE.recording))
