"""Tests of the still image of the cell."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from tests.drawings import ends
from tests.shared.stages import without_stages

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.stages.concluding import find_error_at_task
from basecal.geometry import SE3
from basecal.reporting.cell_view.picture import Label, _place_labels, picture
from basecal.reporting.cell_view.scene import Scene, scene
from basecal.simulation import Scenario, simulate

no_error_at_task = without_stages(find_error_at_task)


@pytest.fixture(scope="module")
def cell_scene() -> Scene:
    """Scene of two arms with recorded poses, a camera and a board."""
    made = simulate(Scenario(samples=6, target="pose"), 0)
    return scene(made.cell, made.recording.samples, calibrate(made.cell, made.recording))


def test_drawing_is_within_the_image(cell_scene: Scene) -> None:
    """All points and the names of bodies are within the image. Each base and flange has three axes."""
    shown = picture(cell_scene)
    places = np.array([[float(x), float(y)] for x, y in re.findall(r"[ML](-?[\d.]+)[ ,](-?[\d.]+)", shown)])
    assert len(places) > 50
    assert np.all(places >= 0)
    assert np.all(places <= [640, 440])
    for name in ("eye_base", "hand_base", "wrist", "board"):
        assert f">{name}<" in shown
    assert shown.count('class="axis-x"') == 4


def test_names_do_not_overlap(cell_scene: Scene) -> None:
    """A board at the position of the camera has its name below the camera's."""
    bodies = tuple(
        replace(body, mount=cell_scene.bodies[0].mount, on=cell_scene.bodies[0].on) for body in cell_scene.bodies
    )
    alike = tuple(
        replace(body, lines=cell_scene.bodies[0].lines, points=cell_scene.bodies[0].points) for body in bodies
    )
    found = re.findall(r'class="label" x="([^"]*)" y="([^"]*)">(\w+)<', picture(replace(cell_scene, bodies=alike)))
    places = {name: (float(x), float(y)) for x, y, name in found}
    (x, y), (x_below, y_below) = places["wrist"], places["board"]
    assert x == x_below
    assert y_below - y >= 15


def test_arm_without_pose_has_only_its_base(cell_scene: Scene) -> None:
    """The base of an arm with unknown poses is drawn, and what it carries is not."""
    arms = tuple(
        replace(arm, known=np.zeros(len(arm.known), dtype=bool)) if arm.name == "hand" else arm
        for arm in cell_scene.arms
    )
    shown = picture(replace(cell_scene, arms=arms))
    assert ">hand_base<" in shown
    assert ">board<" not in shown
    assert shown.count('class="axis-x"') == 3


def test_placing_of_far_labels_terminates():
    """At 1e18 the height of a line is below the resolution of floats; placing labels there once never ended."""
    labels = [Label("hand_base", np.array([1e18, 1e18])) for _ in range(3)]
    assert len(list(_place_labels(labels))) == 3


def shown_axes(svg: str) -> dict[str, list[np.ndarray]]:
    return {axis: ends(svg, f"axis-{axis}") for axis in "xyz"}


def test_upright_cell_fills_the_image(cell_scene: Scene) -> None:
    """Upright bases point upwards. Everything keeps 44 px from the border, and touches this margin on two sides."""
    upright = tuple(
        replace(arm, world_from_base=SE3(np.eye(3), arm.world_from_base.translation)) for arm in cell_scene.arms
    )
    svg = picture(replace(cell_scene, arms=upright, bodies=()))
    for foot, tip in shown_axes(svg)["z"][1::2]:
        assert tip[0] == foot[0]
        assert tip[1] < foot[1] - 5
    bases = [ends(svg, "axis-x")[k][0] for k in (1, 3)]
    assert ends(svg, "floor")[0].tolist() == [bases[0].tolist(), bases[1].tolist()]
    every = np.concatenate(
        [np.concatenate(lines) for lines in (ends(svg, "trail robot-0"), ends(svg, "trail robot-1"))]
    )
    every = np.concatenate([every, *(line for lines in shown_axes(svg).values() for line in lines[1::2])])
    low, high = every.min(0), every.max(0)
    margins = [*low, *(np.array([640, 440]) - high)]
    assert min(margins) == pytest.approx(44, abs=0.1)
    assert sorted(margins)[1] == pytest.approx(44, abs=0.1)
    assert low[0] + high[0] == pytest.approx(640, abs=0.2)
    assert low[1] + high[1] == pytest.approx(440, abs=0.2)


def test_names_are_next_to_their_bodies(cell_scene: Scene) -> None:
    """The name of a base is below its foot, in its colour; that of a body is above it."""
    svg = picture(cell_scene)
    feet = {f"{arm.name}_base": ends(svg, "axis-x")[2 * k + 1][0] for k, arm in enumerate(cell_scene.arms)}
    found = re.findall(r'class="([^"]*)" x="([^"]*)" y="([^"]*)">(\w+)<', svg)
    for number, (name, foot) in enumerate(feet.items()):
        kind, x, y = next((kind, float(x), float(y)) for kind, x, y, word in found if word == name)
        assert kind == f"label robot-{number}"
        assert (x, y) == (pytest.approx(foot[0], abs=0.2), pytest.approx(foot[1] + 18, abs=0.2))
    lines = np.concatenate(ends(svg, "camera"))
    _, x, y, _ = next(each for each in found if each[3] == "wrist")
    assert float(y) == pytest.approx(lines[:, 1].min() - 7, abs=0.2)
    assert lines[:, 0].min() < float(x) < lines[:, 0].max()


@pytest.mark.parametrize(
    ("off", "covered"), [((47, 16), True), ((-47, -16), True), ((49, 16), False), ((47, 18), False), ((0, 17), False)]
)
def test_label_overlap_depends_on_text_length(off: tuple[int, int], covered: bool) -> None:
    """Labels overlap according to the lengths of their texts.

    Four and eight letters overlap within six letters of 8 px horizontally, and within a line of 17 px vertically.
    """
    one, other = Label("abcd", np.array([100.0, 50.0])), Label("abcdefgh", np.array([100.0, 50.0]) + off)
    assert one.covers(other) == other.covers(one) == covered


def test_overlapping_labels_move_down_by_lines() -> None:
    """Three labels at one position are placed below one another; one elsewhere is unchanged."""
    labels = [Label("base", np.array([10.0, 20.0]))] * 3 + [Label("base", np.array([90.0, 20.0]))]
    assert re.findall(r'x="(.*?)" y="(.*?)"', "".join(_place_labels(labels))) == [
        ("10.0", "20.0"), ("10.0", "37.0"), ("10.0", "54.0"), ("90.0", "20.0")
    ]  # fmt: skip


def test_fifth_robot_has_colour_of_first(cell_scene: Scene) -> None:
    many = replace(cell_scene, arms=tuple(replace(cell_scene.arms[0], name=f"r{k}") for k in range(5)), bodies=())
    assert re.findall(r'class="trail (robot-\d)"', picture(many)) == [f"robot-{k}" for k in (0, 1, 2, 3, 0)]


def test_ellipsoids_have_scale_of_the_cell(cell_scene: Scene) -> None:
    """A ball is a circle about its base, and a long axis to the right has its own length."""
    right = cell_scene.across
    scales = []
    for axes in (0.1 * np.eye(3), np.column_stack([0.1 * right, 1e-6 * np.eye(3)[:, 1:]])):
        base = replace(cell_scene.arms[0], world_from_base=SE3.identity(), ellipsoid=axes)
        others = (replace(arm, ellipsoid=None) for arm in cell_scene.arms[1:])
        svg = picture(replace(cell_scene, arms=(base, *others), bodies=()))
        outline = np.concatenate(ends(svg, "ellipsoid"))
        foot = ends(svg, "axis-x")[1][0]
        np.testing.assert_allclose((outline.max(0) + outline.min(0)) / 2, foot, atol=0.2)
        scales.append(np.ptp(outline, axis=0))
    ball, line = scales
    assert ball[0] == pytest.approx(ball[1], rel=0.01)
    assert line[0] == pytest.approx(ball[0], rel=0.01)
    assert line[1] < 1


def test_farther_objects_are_drawn_higher(cell_scene: Scene) -> None:
    """The viewpoint is 0.45 rad above the horizon. Axes to the right, away and up have their own directions."""
    right = cell_scene.across
    turned = SE3(np.column_stack([right, np.cross([0, 0, 1], right), [0, 0, 1]]), np.zeros(3))
    arms = (replace(cell_scene.arms[0], world_from_base=turned), *cell_scene.arms[1:])
    axes = shown_axes(picture(replace(cell_scene, arms=arms, bodies=())))
    x, y, z = (np.subtract(*axes[axis][1][::-1]) for axis in "xyz")
    length = float(x[0])
    assert length > 20
    assert abs(x[1]) <= 0.1
    np.testing.assert_allclose([y, z], [[0, -length * np.sin(0.45)], [0, -length * np.cos(0.45)]], atol=0.25)


def test_body_is_drawn_by_lines_and_points(cell_scene: Scene) -> None:
    """Each line and each point is drawn once; dots have no length."""
    (board,) = (body for body in cell_scene.bodies if body.kind == "target")
    lines = ends(picture(cell_scene), "target")
    lengths = np.array([float(np.linalg.norm(line[-1] - line[0])) for line in lines])
    assert len(lines) == len(board.lines) + len(board.points)
    assert np.count_nonzero(lengths > 0.5) == len(board.lines)
