"""The cell as a still image."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from tests.shared.stages import without_stages

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.stages.concluding import find_error_at_task
from basecal.reporting.cell_view.picture import Label, _place_labels, picture
from basecal.reporting.cell_view.scene import Scene, scene
from basecal.simulation import Scenario, simulate

no_error_at_task = without_stages(find_error_at_task)


@pytest.fixture(scope="module")
def drawn() -> Scene:
    """Two arms known by poses, a camera and a board."""
    made = simulate(Scenario(samples=6, target="pose"), 0)
    return scene(made.cell, made.recording.samples, calibrate(made.cell, made.recording))


def test_everything_is_within_the_picture(drawn: Scene) -> None:
    """Every point of a path, and the names of what is drawn; three axes at each base and flange."""
    shown = picture(drawn)
    places = np.array([[float(x), float(y)] for x, y in re.findall(r"[ML](-?[\d.]+)[ ,](-?[\d.]+)", shown)])
    assert len(places) > 50
    assert np.all(places >= 0)
    assert np.all(places <= [640, 440])
    for name in ("eye_base", "hand_base", "wrist", "board"):
        assert f">{name}<" in shown
    assert shown.count('class="axis-x"') == 4


def test_names_do_not_cover_one_another(drawn: Scene) -> None:
    """A board that is where the camera is has its name below the camera's."""
    bodies = tuple(replace(body, mount=drawn.bodies[0].mount, on=drawn.bodies[0].on) for body in drawn.bodies)
    alike = tuple(replace(body, lines=drawn.bodies[0].lines, points=drawn.bodies[0].points) for body in bodies)
    found = re.findall(r'class="label" x="([^"]*)" y="([^"]*)">(\w+)<', picture(replace(drawn, bodies=alike)))
    places = {name: (float(x), float(y)) for x, y, name in found}
    (x, y), (x_below, y_below) = places["wrist"], places["board"]
    assert x == x_below
    assert y_below - y >= 15


def test_an_arm_whose_pose_is_not_known_has_no_reach(drawn: Scene) -> None:
    """Its base is drawn, and what it carries is not."""
    arms = tuple(
        replace(arm, known=np.zeros(len(arm.known), dtype=bool)) if arm.name == "hand" else arm for arm in drawn.arms
    )
    shown = picture(replace(drawn, arms=arms))
    assert ">hand_base<" in shown
    assert ">board<" not in shown
    assert shown.count('class="axis-x"') == 3


def test_labels_too_far_to_be_moved_end():
    """At 1e18 a line's height is no step, which once never ended."""
    labels = [Label("hand_base", np.array([1e18, 1e18])) for _ in range(3)]
    assert len(list(_place_labels(labels))) == 3
