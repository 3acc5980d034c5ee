"""Tests of a lens that sags in its holder, which rotates the camera about its own centre."""

from __future__ import annotations

import numpy as np

from basecal.effects.faces.effect import FoundEffect
from basecal.effects.lens_sag import candidates, words
from basecal.simulation import Scenario
from made_views import views_of


def test_lens_sag_shifts_images_along_gravity():
    """Points of the target move across the optical axis by distance times rotation, along gravity in the image."""
    of = views_of(Scenario(samples=12))
    (found,) = candidates(of)
    assert found.about == ("wrist",)
    at = of.state.camera_from_target(of.groups[0], of.problem.stops)
    mount = of.transform("eye_flange_from_wrist").rotation
    down = of.down_in_flange(0, "eye")
    across = (down - down.mean(0)) @ mount
    shift = (at.rotation @ found.moves[0][:, 0, :3])[..., 0]
    np.testing.assert_allclose(shift[:, :2], across[:, :2] * at.translation[:, 2:], atol=1e-9)


def test_fixed_camera_has_no_lens_sag():
    """A stationary camera has the same gravity in all its images."""
    views = views_of(Scenario(samples=12, layout="eye_to_hand"))
    assert list(candidates(views)) == []


def test_lens_sag_message_has_camera_and_angle():
    """The message names the camera and the sag angle with its sigma."""
    found = FoundEffect(
        "lens_sag", "lens-sag", "c", True, False, None, "", np.array([-1.3e-3]), np.array([[4e-8]]), np.zeros(1)
    )
    assert words(found).what == "The lens of c sags by 1.30 ± 0.20 mrad in its holder."
