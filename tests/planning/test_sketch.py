"""A cell as far as it is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import Sample, Unknown
from basecal.errors import InputError
from basecal.geometry import SE3
from basecal.planning.sketch import led_sketch, sketch_cell
from shared.facing_arms import facing_arms
from shared.running_cell import home

WORLD = facing_arms()


def with_truth(cell):
    """The cell with every transform known as it is."""
    known = {name: Unknown("fixed", true) for name, true in WORLD.truth.items()}
    camera, board = cell.cameras["wrist"], cell.targets["board"]
    return replace(
        cell,
        bases={"hand": known["eye_base_from_hand_base"]},
        cameras={"wrist": replace(camera, mount=known["eye_flange_from_wrist"])},
        targets={"board": replace(board, mount=known["hand_flange_from_board"])},
    )


def test_it_predicts_what_is_seen():
    """With the truth the board stands straight before the camera, 0.65 m away, as the cell was made."""
    seen = sketch_cell(with_truth(WORLD.cell)).camera_from_target(Sample(0, robots=home(WORLD)))
    middle = seen @ WORLD.cell.targets["board"].target.points.mean(0)
    np.testing.assert_allclose(middle, [0, 0, 0.65], atol=1e-9)


def test_guesses_will_do():
    """With what the cell states it is off by some centimetres, and says which arms move."""
    sketch = sketch_cell(WORLD.cell)
    middle = sketch.camera_from_target(Sample(0, robots=home(WORLD))) @ WORLD.cell.targets["board"].target.points.mean(
        0
    )
    assert 1e-3 < np.linalg.norm(middle - [0, 0, 0.65]) < 0.2
    assert (sketch.view, sketch.movers) == (("wrist", "board"), ("eye", "hand"))


def test_what_is_missing_is_named():
    """A base nobody guessed, and a cell without a target, are told with what to write."""
    with pytest.raises(InputError, match=r"give eye_base_from_hand_base a value, or .* `guess:"):
        sketch_cell(replace(WORLD.cell, bases={"hand": Unknown()}))
    with pytest.raises(InputError, match="no camera with a target"):
        sketch_cell(replace(WORLD.cell, targets={}))
    with pytest.raises(InputError, match="five of them of one spot"):
        sketch_cell(replace(WORLD.cell, targets={}, sees_scene=True))
    with pytest.raises(InputError, match="wrist: a plan needs a lens"):
        _ = sketch_cell(
            replace(WORLD.cell, cameras={"wrist": replace(WORLD.cell.cameras["wrist"], intrinsics=None)})
        ).lens


def test_who_moves_carries_the_camera_or_the_target():
    """The camera's first; of a scene each that carries a camera."""
    assert sketch_cell(WORLD.cell).movers == ("eye", "hand")
    (wrist,), (board,) = WORLD.cell.cameras.values(), WORLD.cell.targets.values()
    still = replace(
        WORLD.cell, targets={board.name: replace(board, on="world", mount=Unknown("fixed", SE3.identity()))}
    )
    assert sketch_cell(still).movers == ("eye",)
    cameras = {"wrist": wrist, "top": replace(wrist, name="top", on="world"), "other": replace(wrist, name="other")}
    scene = led_sketch(replace(WORLD.cell, sees_scene=True, cameras=cameras, targets={}))
    assert (scene.movers, scene.view) == (("eye",), ("wrist", ""))


def test_arms_that_are_led_need_a_camera():
    """Of a scene; a cell with a target is sketched as ever."""
    assert led_sketch(WORLD.cell).view == ("wrist", "board")
    with pytest.raises(InputError, match="the cell has no camera"):
        led_sketch(replace(WORLD.cell, sees_scene=True, cameras={}, targets={}))
