"""Tests of export lines for the controllers that wrote the poses."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell import Calibration, Cell, CellCamera, Robot
from basecal.errors import InputError, RefusedCalibration
from basecal.exchange.exporters.controllers import controller_kind, controllers_text, recorded_frame
from basecal.geometry import SE3, PoseEstimate

ESTIMATE = PoseEstimate(SE3.from_rotvec([0, 0, 0.5], [1, 0, 0]), 1e-8 * np.eye(6))


def cell(**robots: Robot) -> Cell:
    return Cell(next(iter(robots)), robots, cameras={"cam": CellCamera("cam", next(iter(robots)))})


@pytest.mark.parametrize(
    ("robot", "kind"),
    [
        (Robot("a", controller={"format": "abb"}), "abb"),
        (Robot("a", controller={"format": "franka"}), "matrix"),
        (Robot("a", frames={"base": "base_link"}), "ros"),
        (Robot("a"), "matrix"),
    ],
)
def test_export_kind_of_controller(robot: Robot, kind: str) -> None:
    """The export follows the controller's format, else its frames in ROS, else it is a matrix."""
    assert controller_kind(robot) == kind


def test_recorded_frame_is_base_by_default() -> None:
    """The recorded frame is the robot's own base, by its name in ROS, unless another is stated."""
    assert "recorded in: base_link, its base: no other was" in recorded_frame(Robot("a", frames={"base": "base_link"}))
    stated = recorded_frame(Robot("a", controller={"format": "abb", "base": "wobj3", "tool": "tool2"}))
    assert stated.endswith("recorded in: wobj3, which is a_base here; a_flange is tool2")


def test_controller_export_has_only_known_frames() -> None:
    """`$ROBROOT` is written beside a KUKA and `Base Frame` beside an ABB, but neither with a robot of another maker."""

    def text(first: str, second: str) -> str:
        formats = {"a": {"format": first}, "b": {"format": second} if second else {}}
        made = cell(**{name: Robot(name, controller=controller) for name, controller in formats.items()})
        return controllers_text(Calibration("good", {"a_base_from_b_base": ESTIMATE}), made)

    assert "$ROBROOT={X 1000" in text("kuka", "kuka")
    assert "$ROBROOT={X 1000" in text("kuka", "")
    assert "Base Frame of b, where" in text("abb", "abb")
    mixed = text("kuka", "abb")
    assert "$BASE={X 1000" in mixed
    assert "PERS wobjdata wobj_a_base" in mixed
    assert "$ROBROOT={" not in mixed
    assert "Base Frame" not in mixed


def test_mount_is_exported_for_carrying_robot() -> None:
    """The single robot gets the mount of its camera. A transform of no robot, and a refused calibration, are errors."""
    made = cell(a=Robot("a", controller={"format": "abb"}))
    calibration = Calibration("good", {"a_flange_from_cam": ESTIMATE}, {"a_flange_from_cam": "free"})
    assert "[[1000.000" in controllers_text(calibration, made)
    with pytest.raises(InputError, match="no transform is in the base or flange of a robot"):
        controllers_text(calibration, made, "cam_from_a_flange")
    with pytest.raises(RefusedCalibration):
        controllers_text(Calibration("refused"), made)


def test_device_of_the_world_is_exported_for_its_own_base() -> None:
    """A camera beside two robots is stated in the base that it was calibrated in, and not again for the other robot."""
    robots = {name: Robot(name, controller={"format": "abb"}) for name in ("a", "b")}
    made = Cell("a", robots, cameras={"hall": CellCamera("hall", "world")})
    known = dict.fromkeys(("a_base_from_b_base", "a_base_from_hall"), ESTIMATE)
    calibration = Calibration("good", known, dict.fromkeys(known, "free"))
    text = controllers_text(calibration, made, "a_base_from_hall")
    assert "for a, in the frame" in text
    assert "for b, in the frame" not in text
    both = controllers_text(calibration, made, "a_base_from_b_base")
    assert ("for a, in the frame" in both, "for b, in the frame" in both) == (True, True)
    with pytest.raises(InputError, match="no transform is in the base or flange of a robot"):
        controllers_text(calibration, made, "hall_from_a_base")
