"""Mounts that are stated as fixed, and are elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Unknown
from basecal.effects.fixed_transform import candidates
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from made_views import views_of

SCENARIO = Scenario(samples=30, camera_mount="fixed", robot_noise=(1e-4, 2e-4), state_robot_noise=False, position_m=0.2)
MOUNT = "eye_flange_from_wrist"


def test_only_fixed_frames_are_candidates():
    """Each moves its views as an unknown would."""
    views = views_of(Scenario(samples=6, camera_mount="fixed"))
    (found,) = candidates(views)
    assert found.about == (MOUNT,)
    np.testing.assert_array_equal(found.moves[0][:, 0], views.frame_jacobian(0, MOUNT))


@pytest.mark.parametrize(
    ("turn_rad", "verdict", "codes"),
    [(0.0, "good", []), (1.5e-3, "doubtful", ["fixed-contradicted"]), (1e-2, "refused", ["fixed-contradicted"])],
)
def test_a_wrong_mount_is_named(turn_rad, verdict, codes):
    """As itself, not as what moves the data nearly alike; a right one is not accused, a grossly wrong one refused."""
    made = simulate(SCENARIO, 4)
    mount = made.cell.transforms[MOUNT].mean @ SE3.exp(turn_rad * np.array([0.3, 0.0, 0.0, 0.0, 1.0, 0.0]))
    found = calibrate(made.cell.with_transform(MOUNT, Unknown("fixed", mount)), made.recording)
    assert found.verdict == verdict
    assert [finding.code for finding in found.findings if finding.severity != "info"] == codes
