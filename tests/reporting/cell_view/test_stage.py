"""Tests of scenes as values for the templates of pages."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np

from basecal.cell import ErrorMap, RobotState, Sample
from basecal.planning.sketch import sketch_cell
from basecal.reporting.cell_view.stage import _legend, json_inside_html, scene_values, stated_scene
from shared.facing_arms import facing_arms

HOME = {name: RobotState(joints_rad=joints) for name, joints in facing_arms().home.items()}


def test_scene_of_stated_cell() -> None:
    """The bases are those of the sketch, without ellipsoids of sigmas, and a sentence is the legend."""
    sketch = sketch_cell(facing_arms().cell)
    shown = scene_values(stated_scene(sketch, [Sample(0, robots=HOME)]))
    arms = {arm["name"]: arm for arm in json.loads(shown["scene_json"])["arms"]}
    np.testing.assert_allclose(
        arms["hand"]["world_from_base"][:3], sketch.world_from_base("hand").translation, atol=1e-5
    )
    assert arms["hand"]["ellipsoid"] is None
    assert shown["picture"].startswith("<svg")
    assert shown["legend"] == ["Axes: x red, y green, z blue. Dots: flanges at each sample."]


def test_scene_without_samples_has_no_script_data() -> None:
    """Only the still image remains."""
    assert scene_values(stated_scene(sketch_cell(facing_arms().cell), []))["scene_json"] == ""


def test_json_inside_html_is_escaped() -> None:
    """A name with markup does not end the script element, and the JSON is unchanged."""
    text = json_inside_html({"name": "</script><b>"})
    assert "<" not in text
    assert json.loads(text) == {"name": "</script><b>"}


def test_legend_describes_scale_colours_and_omissions() -> None:
    """The legend has the smallest and the largest error in mm, the share of samples shown, and missing bodies."""
    plain = stated_scene(sketch_cell(facing_arms().cell), [Sample(0, robots=HOME)])
    errors = ErrorMap(np.zeros((3, 3)), np.array([2e-3, 1.2e-3, 5.1e-3]), np.zeros(3))
    arms = (replace(plain.arms[0], ellipsoid=np.eye(3)), *plain.arms[1:])
    legend = _legend(replace(plain, arms=arms, errors=errors, total=2, missing=("a", "b"), ellipsoid_scale=12.5))
    assert legend[1:] == [
        "Ellipsoid: 1 sigma of the position of requested transforms, drawn 12.5 times as large.",
        "Cloud: 95 % of errors stay below 1.2 mm where it is pale and 5.1 mm where it is full.",
        "1 of 2 samples are shown.",
        "Not drawn, as their poses are unknown: a, b.",
    ]
    bodies = (replace(plain.bodies[0], ellipsoid=np.eye(3)), *plain.bodies[1:])
    assert _legend(replace(plain, bodies=bodies))[1:] == ["Ellipsoid: 1 sigma of the position of requested transforms."]
