"""How far an image moves."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.geometry import SE3
from basecal.vision.draw.render import RenderSettings, expose, radiance
from basecal.vision.image_motion import reduce_image, shift_between
from shared.facing_arms import facing_arms

WORLD = facing_arms()
BOARD, LENS = WORLD.cell.targets["board"].target, WORLD.lenses["wrist"]
SETTINGS = RenderSettings(texture=6.0)
AT = SE3(np.eye(3), np.array([0.0, 0.0, 0.65]) - BOARD.points.mean(0))


def levels(px):
    """The board moved by so many pixels, along both axes alike."""
    along = px / 1010 * 0.65 / np.sqrt(2)
    return radiance(LENS, [(BOARD, SE3(np.eye(3), np.array([along, along, 0])) @ AT)], SETTINGS)


STILL = levels(0.0)


def image_shift(first, second):
    """How far an image moves [px]."""
    return shift_between(reduce_image(first), reduce_image(second))


def test_noise_is_no_motion():
    """Of twenty images of the same board none seems to move."""
    first = expose(STILL, SETTINGS, 0)
    assert [image_shift(first, expose(STILL, SETTINGS, seed)) for seed in range(1, 21)] == [0.0] * 20


@pytest.mark.parametrize("px", [0.2, 0.5, 1.0])
def test_a_shift_is_measured(px):
    """A fifth of a pixel is seen, and measured to a fifth of itself."""
    assert image_shift(expose(STILL, SETTINGS, 0), expose(levels(px), SETTINGS, 1)) == pytest.approx(px, rel=0.2)


def test_nothing_to_see_and_other_sizes():
    """A plain image moves nowhere; an image of another size is another image."""
    plain = np.full((240, 320), 100, dtype=np.uint8)
    assert image_shift(plain, plain) == 0.0
    assert shift_between(reduce_image(plain), reduce_image(plain[:200])) == np.inf
