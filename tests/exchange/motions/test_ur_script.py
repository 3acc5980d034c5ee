"""A program of URScript."""

from __future__ import annotations

import re

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.exchange.motions.ur_script import write_motion
from basecal.geometry import SE3
from shared.motion_ways import joints_of, of_joints, of_poses


def moves(text: str) -> list[tuple[str, list[float]]]:
    """Whether each `movej` has a pose, and its numbers."""
    found = re.findall(r"movej\((p?)\[([^\]]*)\], a=[\d.]+, v=0\.5\)", text)
    return [(kind, [float(number) for number in numbers.split(",")]) for kind, numbers in found]


def test_joints_are_gone_to_in_order() -> None:
    """A move, a rest and a question for each sample; the program is begun, for one arm."""
    text = write_motion(of_joints("eye"))
    assert np.allclose([numbers for _, numbers in moves(text)], joints_of(of_joints(), "eye"), atol=1e-6)
    assert text.count("sleep(2)") == text.count("blocking=True") == 3
    assert text.startswith("def basecal_eye():")
    assert text.rstrip().endswith("end\nbasecal_eye()")
    with pytest.raises(InputError, match="--robot"):
        write_motion(of_joints())


def test_poses_are_rotation_vectors() -> None:
    """Of the flange in the base, for a tool that is the flange."""
    way = of_poses()
    text = write_motion(way)
    assert "set_tcp(p[0, 0, 0, 0, 0, 0])" in text
    for (kind, numbers), sample in zip(moves(text), way.samples, strict=True):
        apart = way.pose("hand", sample).inverse() @ SE3.from_rotvec(np.array(numbers[3:]), np.array(numbers[:3]))
        assert kind == "p"
        assert np.abs(apart.log()).max() < 1e-6
