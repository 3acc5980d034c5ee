"""Tests of the text of new cells."""

from __future__ import annotations

import re

import pytest

from basecal.cell.files import cell_from_dict
from basecal.cell.format.yaml_text import parse_yaml
from basecal.cell.targets.registry import TARGETS
from basecal.exchange.importing.template import cell_text, robot_names


def read(text):
    return cell_from_dict(parse_yaml(text, "text").data, path="cell.yaml")


@pytest.mark.parametrize("robots", [1, 2, 4])
def test_template_robot_names(robots):
    """The eye carries the first camera, the hand the first target, and the others are numbered."""
    assert robot_names(robots) == ["eye", "hand", "arm3", "arm4"][:robots]


@pytest.mark.parametrize("kind", [*TARGETS, "pose"])
def test_each_camera_sees_target_of_next_robot(kind):
    """Three robots form two pairs; the bases of all but the first are requested."""
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
def test_single_robot_carries_camera_or_target(on_world, robot, camera_on, target_on):
    """The other one is on the world."""
    cell = read(cell_text(1, "charuco", camera_on_world=on_world))
    assert list(cell.robots) == [robot]
    assert cell.cameras["camera"].on == camera_on
    assert cell.targets["target"].on == target_on


def test_led_needs_known_lens():
    """A board determines the lens, a single LED does not; a cell of poses has no pixel noise."""
    assert read(cell_text(2, "charuco")).cameras["camera"].intrinsics.status == "free"
    light = cell_text(2, "led")
    assert read(light).cameras["camera"].intrinsics.status == "fixed"
    assert "Put your camera's numbers here" in light
    assert "pixel_px" in light
    poses = cell_text(2, "pose")
    assert read(poses).cameras["camera"].intrinsics is None
    assert "pixel_px" not in poses


@pytest.mark.parametrize("robots", [1, 3])
def test_template_has_no_trailing_blanks(robots):
    """No line ends with a blank, and no line has a tab."""
    text = cell_text(robots, "charuco")
    assert all(line == line.rstrip() for line in text.splitlines())
    assert "\t" not in text


def test_template_comments_name_requested_transforms():
    """Mounts are named by their carrier, or by the reference's base if they are on the world.

    All robots but the first have a base.
    """
    text = cell_text(3, "charuco")
    assert [word for line in text.splitlines() for word in re.findall(r"# (\w+_from_\w+)\b", line)] == [
        "eye_base_from_hand_base", "eye_base_from_arm3_base", "eye_flange_from_camera", "hand_flange_from_camera2",
        "hand_flange_from_target", "arm3_flange_from_target2",
    ]  # fmt: skip
    assert parse_yaml(text, "text").data["bases"] == {name: {"status": "free"} for name in ("hand", "arm3")}
    still = cell_text(1, "charuco", camera_on_world=True)
    assert re.findall(r"# (\w+_from_\w+)\b", still) == ["hand_base_from_camera", "hand_flange_from_target"]
    assert "bases" not in parse_yaml(still, "text").data


@pytest.mark.parametrize("robots", [["left", "right"], ["left"]])
def test_template_accepts_robot_names(robots):
    """The first robot is the reference, and the only line with the comment about noise."""
    text = cell_text(robots, "charuco")
    cell = read(text)
    assert (cell.reference, list(cell.robots)) == ("left", robots)
    assert cell.cameras["camera"].on == "left"
    assert cell.targets["target"].on == ("right" if len(robots) == 2 else "world")
    assert text.count("optional: {noise") == 1
    assert "optional: {noise" in next(line for line in text.splitlines() if line.startswith("  left: {}"))


def test_template_targets_have_given_shape():
    """All targets have the shape with different markers; comments of the example are omitted."""
    shape = {"kind": "charuco", "squares": [4, 6], "square_m": 0.05, "marker_m": 0.03, "dictionary": "DICT_4X4_50"}
    given, example = cell_text(3, "charuco", shape=shape), cell_text(3, "charuco")
    targets = parse_yaml(given, "text").data["targets"]
    assert [entry["squares"] for entry in targets.values()] == [[4, 6], [4, 6]]
    assert targets["target"]["dictionary"] != targets["target2"]["dictionary"]
    assert [text.count("columns, rows of squares") for text in (given, example)] == [0, 1]


def test_template_fields_are_plain_yaml():
    """Text has no quotes; lists and booleans are in YAML notation."""
    shape = {"kind": "charuco", "squares": [4, 6], "square_m": 0.05, "marker_m": 0.03, "dictionary": "DICT_4X4_50"}
    text = cell_text(1, "charuco", shape={**shape, "legacy_pattern": True})
    for line in (
        "kind: charuco",
        "squares: [4, 6]",
        "square_m: 0.05",
        "dictionary: DICT_4X4_50",
        "legacy_pattern: true",
    ):
        assert f"    {line}\n" in text
