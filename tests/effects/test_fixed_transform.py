"""Tests of mounts that are stated as fixed but are elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Unknown
from basecal.effects.fixed_transform import candidates, disagreement
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from made_views import views_of

SCENARIO = Scenario(samples=30, camera_mount="fixed", robot_noise=(1e-4, 2e-4), state_robot_noise=False, position_m=0.2)
MOUNT = "eye_flange_from_wrist"


def test_only_fixed_frames_are_candidates():
    """A fixed frame moves its views like an unknown one."""
    views = views_of(Scenario(samples=6, camera_mount="fixed"))
    (found,) = candidates(views)
    assert found.about == (MOUNT,)
    np.testing.assert_array_equal(found.moves[0][:, 0], views.frame_jacobian(0, MOUNT))


@pytest.mark.journey
@pytest.mark.parametrize(
    ("turn_rad", "verdict", "codes"),
    [(0.0, "good", []), (1.5e-3, "doubtful", ["fixed-contradicted"]), (1e-2, "refused", ["fixed-contradicted"])],
)
def test_wrong_fixed_mount_is_named(turn_rad, verdict, codes):
    """A wrong mount is named, rather than an effect that moves the data similarly.

    A correct one is accepted, a grossly wrong one refused.
    """
    made = simulate(SCENARIO, 4)
    mount = made.cell.transforms[MOUNT].mean @ SE3.exp(turn_rad * np.array([0.3, 0.0, 0.0, 0.0, 1.0, 0.0]))
    found = calibrate(made.cell.with_transform(MOUNT, Unknown("fixed", mount)), made.recording)
    assert found.verdict == verdict
    assert [finding.code for finding in found.findings if finding.severity != "info"] == codes


def test_wrong_mount_is_not_attributed_to_lens():
    """A camera mount off by 5 mm with stated noise is named with its size, though a lens absorbs most of it."""
    made = simulate(Scenario(samples=15, camera_mount="fixed", robot_noise=(1e-4, 2e-4)), 500)
    mount = made.cell.transforms[MOUNT].mean @ SE3.exp(np.array([3e-3, 4e-3, 0, 0, 0, 0]))
    found = calibrate(made.cell.with_transform(MOUNT, Unknown("fixed", mount)), made.recording)
    (finding,) = (each for each in found.findings if each.severity != "info")
    assert (finding.code, finding.about) == ("fixed-contradicted", (MOUNT,))
    assert finding.what.startswith("The stated mount of wrist disagrees with the data by ")
    shift_mm, _, sigma_mm = finding.what.split("by ")[1].split()[:3]
    assert abs(float(shift_mm) - 5) < 3.5 * float(sigma_mm)


@pytest.mark.parametrize(
    ("name", "stated"), [("eye_base_from_hand_base", "base of hand"), ("hand_flange_from_board", "mount of board")]
)
def test_disagreement_names_base_or_mount(name, stated):
    """The message names a base or a mount, with the shift and the rotation, each with its own sigma."""
    what, do = disagreement(name, np.array([5e-3, 0, 0, 0, 0, 1e-3]), np.diag([1e-8] * 3 + [1e-10] * 3))
    assert what == f"The stated {stated} disagrees with the data by 5.00 ± 0.10 mm and 0.05730 ± 0.00057 deg."
    assert name in do[0]
