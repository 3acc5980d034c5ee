"""The text of new cells."""

from __future__ import annotations

import pytest

from basecal.cell.files import cell_from_dict
from basecal.cell.format.yaml_text import parse_yaml
from basecal.cell.targets.registry import TARGETS
from basecal.exchange.importing.template import cell_text, robot_names


def read(text):
    return cell_from_dict(parse_yaml(text, "text").data, path="cell.yaml")


@pytest.mark.parametrize("robots", [1, 2, 4])
def test_names_of_robots(robots):
    """The eye carries the first camera, the hand the first target, the others are numbered on."""
    assert robot_names(robots) == ["eye", "hand", "arm3", "arm4"][:robots]


@pytest.mark.parametrize("kind", [*TARGETS, "pose"])
def test_each_camera_sees_what_the_next_robot_carries(kind):
    """Of three robots two pairs; the bases of all but the first are asked for."""
    cell = read(cell_text(3, kind))
    assert cell.reference == "eye"
    assert {name: camera.on for name, camera in cell.cameras.items()} == {"camera": "eye", "camera2": "hand"}
    assert {name: target.on for name, target in cell.targets.items()} == {"target": "hand", "target2": "arm3"}
    assert cell.bases.keys() == {"hand", "arm3"}
    assert all((target.target is None) == (kind == "pose") for target in cell.targets.values())


@pytest.mark.parametrize(
    ("on_world", "robot", "camera_on", "target_on"),
    [(False, "eye", "eye", "world"), (True, "hand", "world", "hand")],
)
def test_a_single_robot_carries_the_one_or_the_other(on_world, robot, camera_on, target_on):
    """The other stands on the world."""
    cell = read(cell_text(1, "charuco", camera_on_world=on_world))
    assert list(cell.robots) == [robot]
    assert cell.cameras["camera"].on == camera_on
    assert cell.targets["target"].on == target_on


def test_a_light_needs_a_lens_that_is_known():
    """A board determines the lens, a single light does not; given poses nothing is said of pixels."""
    assert read(cell_text(2, "charuco")).cameras["camera"].intrinsics.status == "free"
    light = cell_text(2, "led")
    assert read(light).cameras["camera"].intrinsics.status == "fixed"
    assert "Put your camera's numbers here" in light
    assert "pixel_px" in light
    poses = cell_text(2, "pose")
    assert read(poses).cameras["camera"].intrinsics is None
    assert "pixel_px" not in poses


@pytest.mark.parametrize("robots", [1, 3])
def test_no_line_ends_with_a_blank(robots):
    """Nor is any a tab wide."""
    text = cell_text(robots, "charuco")
    assert all(line == line.rstrip() for line in text.splitlines())
    assert "\t" not in text
