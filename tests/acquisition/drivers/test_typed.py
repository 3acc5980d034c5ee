"""Tests of typed poses as shown by pendants."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from basecal.acquisition.driver import Place
from basecal.acquisition.drivers.typed import TypedRobot, open_robot
from basecal.cell import Cell, Robot
from basecal.errors import DatasetError, DriverError
from basecal.geometry import SE3
from basecal.geometry.rotation import rotation_exp
from basecal.simulation.arms import six_axis

CELL = Cell("arm", {"arm": Robot("arm")})
X, Y, Z = np.eye(3)
PI = f"0 {np.pi / 2} {-np.pi} {np.pi / 18} 0 0"


def place(**options):
    return Place("arm", CELL, Path("."), options)


def typed(notation, text):
    return TypedRobot(place(), notation, io.StringIO(text)).state().state.base_from_flange


@pytest.mark.parametrize(
    ("notation", "text", "rotation"),
    [
        ("ur", "0.1, 0.2, 0.3, 0.4, 0.5, 0.6", rotation_exp(np.array([0.4, 0.5, 0.6]))),
        ("ur", "p[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]", rotation_exp(np.array([0.4, 0.5, 0.6]))),
        (
            "kuka",
            "100 200 300 10 20 30",
            rotation_exp(np.radians(10) * Z) @ rotation_exp(np.radians(20) * Y) @ rotation_exp(np.radians(30) * X),
        ),
        (
            "fanuc",
            "100 200 300 10 20 30",
            rotation_exp(np.radians(30) * Z) @ rotation_exp(np.radians(20) * Y) @ rotation_exp(np.radians(10) * X),
        ),
        ("abb", "[100,200,300],[0.8,0.6,0,0]", rotation_exp(2 * np.arccos(0.8) * X)),
    ],
)
def test_conventions_of_pendants(notation, text, rotation):
    """Typed numbers are the pose by the maker's manual, as a product of rotations about single axes."""
    pose = typed(notation, text)
    np.testing.assert_allclose(pose.translation, [0.1, 0.2, 0.3], atol=1e-15)
    np.testing.assert_allclose(pose.rotation, rotation, atol=1e-12)


def test_unreadable_line_is_requested_again(capsys):
    """Too few numbers, non-finite ones and an invalid quaternion are reported, and the next line counts."""
    robot = TypedRobot(place(), "abb", io.StringIO("1 2 3\n1 2 3 9 9 9 9\n1e999 0 0 1 0 0 0\n0 0 0 1 0 0 0\n"))
    assert np.array_equal(robot.state().state.base_from_flange.rotation, SE3.identity().rotation)
    said = capsys.readouterr().err
    assert "3 numbers, expected 7" in said
    assert "a number is beyond" in said
    assert said.count("arm, abb: ") == 4


@pytest.mark.parametrize(("notation", "text"), [("joints_deg", "0 90 -180 1e1 0 0"), ("joints_rad", PI)])
def test_joints_are_typed_in_degrees_or_radians(notation, text):
    """The unit is stated."""
    armed = replace(CELL, robots={"arm": Robot("arm", chain=six_axis())})
    robot = TypedRobot(Place("arm", armed, Path("."), {}), notation, io.StringIO(text))
    np.testing.assert_allclose(robot.state().state.joints_rad, np.pi * np.array([0, 0.5, -1, 1 / 18, 0, 0]))


def test_joints_need_a_urdf(capsys):
    """Joints of a robot without URDF are refused; the end of the input is an error."""
    with pytest.raises(DriverError, match="the input has ended"):
        TypedRobot(place(), "joints_deg", io.StringIO("1 2 3 4 5 6\n")).state()
    assert "joints need urdf" in capsys.readouterr().err


def test_unknown_convention_is_refused():
    """The error has its field."""
    with pytest.raises(DatasetError, match=r"driver\.notation: no notation 'yaskaw' \(did you mean"):
        open_robot(place(notation="yaskaw"))
