"""A scene as pages show it."""

from __future__ import annotations

import json

import numpy as np

from basecal.cell import RobotState, Sample
from basecal.planning.sketch import sketch_cell
from basecal.reporting.cell_view.stage import json_inside_html, stage, stated_scene
from shared.facing_arms import facing_arms

HOME = {name: RobotState(joints_rad=joints) for name, joints in facing_arms().home.items()}


def test_a_cell_is_drawn_as_it_is_stated() -> None:
    """Bases where the sketch has them, nothing of sigmas, a sentence for what is seen."""
    sketch = sketch_cell(facing_arms().cell)
    shown = stage(stated_scene(sketch, [Sample(0, robots=HOME)]))
    arms = {arm["name"]: arm for arm in json.loads(shown["scene_json"])["arms"]}
    np.testing.assert_allclose(
        arms["hand"]["world_from_base"][:3], sketch.world_from_base("hand").translation, atol=1e-5
    )
    assert arms["hand"]["ellipsoid"] is None
    assert shown["picture"].startswith("<svg")
    assert shown["legend"] == ["Axes: x red, y green, z blue. Dots: flanges at each sample."]


def test_without_samples_no_script_gets_data() -> None:
    """The still image alone is left."""
    assert stage(stated_scene(sketch_cell(facing_arms().cell), []))["scene_json"] == ""


def test_names_cannot_end_the_element() -> None:
    """JSON stays JSON."""
    said = json_inside_html({"name": "</script><b>"})
    assert "<" not in said
    assert json.loads(said) == {"name": "</script><b>"}
