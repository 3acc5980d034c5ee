"""One URDF of all robots."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from basecal.cell import Calibration, Cell, Robot
from basecal.errors import InputError
from basecal.exchange.exporters.urdf_cell import export_text
from basecal.exchange.exports.wanted import Wanted
from export_example import CALIBRATION, POSE

DATA = Path(__file__).parents[2] / "data" / "urdf"
EYE = Robot("eye", urdf="six_axis.urdf", base_link="base_link", flange_link="tool0")
HAND = Robot("hand", frames={"base": "base_link"})
CELL = Cell("eye", robots={"eye": EYE, "hand": HAND})
BOTH = (DATA / "six_axis.urdf", DATA / "six_axis.urdf")


def stands(text: str, parent: str, child: str):
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, pinocchio.neutral(model))
    first, second = (data.oMf[model.getFrameId(link)].homogeneous for link in (parent, child))
    return np.linalg.inv(first) @ second


def test_robots_stand_where_they_were_found():
    """From the URDFs given, the base being the link that the cell names, or else the root."""
    text = export_text(Wanted((), ("made by",), CALIBRATION, CELL, DATA, urdfs=BOTH))
    np.testing.assert_allclose(stands(text, "eye_base_link", "hand_base_link"), POSE.matrix, atol=1e-12)
    assert "<!-- made by -->" in text
    assert "<!-- hand: six_axis.urdf, its base is the link base_link -->" in text
    nameless = replace(CELL, robots={"eye": EYE, "hand": Robot("hand")})
    text = export_text(Wanted((), (), CALIBRATION, nameless, DATA, urdfs=BOTH))
    np.testing.assert_allclose(stands(text, "eye_base_link", "hand_world"), POSE.matrix, atol=1e-12)


def test_urdfs_of_the_cell_are_taken_where_none_is_given():
    """In its own folder."""
    own = replace(CELL, robots={"eye": EYE, "hand": replace(EYE, name="hand")})
    text = export_text(Wanted((), (), CALIBRATION, own, DATA))
    np.testing.assert_allclose(stands(text, "eye_base_link", "hand_base_link"), POSE.matrix, atol=1e-12)


def test_what_is_missing_is_said():
    """A URDF, the place of a robot, and the cell."""
    with pytest.raises(InputError, match="1 URDFs for 2 robots: give one each, --urdf for eye, hand"):
        export_text(Wanted((), (), CALIBRATION, CELL, DATA))
    with pytest.raises(InputError, match="where 'hand' stands is not known: there is no eye_base_from_hand_base"):
        export_text(Wanted((), (), Calibration("good"), CELL, DATA, urdfs=BOTH))
    with pytest.raises(InputError, match="needs the cell and its folder"):
        export_text(Wanted((), (), CALIBRATION))
