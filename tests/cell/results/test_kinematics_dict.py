"""Joint offsets, link parameters and compliances as plain data, and back."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.calibration import Compliances, JointOffsets, LinkParameters
from basecal.cell.results import kinematics_dict as of
from basecal.errors import InputError

OFFSETS = JointOffsets(("a", "b"), np.array([0.1, 0.2]), np.diag([4.0, 9.0]), np.array([True, False]))
LINKS = LinkParameters(np.arange(18.0).reshape(3, 6), np.arange(18.0, 36.0).reshape(3, 6))
BENDS = Compliances(("a", "b"), np.array([0.1, 0.2]), np.array([0.3, 0.4]), np.array([False, True]))


def test_joint_offsets():
    """A field for each number, by robot; read back alike."""
    data = of.joint_offsets_to_dict({"arm": OFFSETS})
    assert data["joint_offsets_rad"]["arm"].tolist() == [0.1, 0.2]
    assert data["joint_offsets_sigma_rad"]["arm"].tolist() == [2.0, 3.0]
    assert data["joint_names"] == {"arm": ("a", "b")}
    (back,) = of.joint_offsets_from_dict(data).values()
    assert back.joints == ("a", "b")
    np.testing.assert_array_equal(back.covariance, OFFSETS.covariance)
    np.testing.assert_array_equal(back.rad, OFFSETS.rad)
    np.testing.assert_array_equal(back.seen, OFFSETS.seen)


def test_link_parameters():
    """Translations before rotations, with their sigmas; read back alike."""
    data = of.link_parameters_to_dict({"arm": LINKS})
    assert data["arm"]["t_m"].tolist() == [[0, 1, 2], [6, 7, 8], [12, 13, 14]]
    assert data["arm"]["r_rad"][0].tolist() == [3, 4, 5]
    assert data["arm"]["sigma_t_m"][0].tolist() == [18, 19, 20]
    (back,) = of.link_parameters_from_dict(data).values()
    np.testing.assert_array_equal(back.tangents, LINKS.tangents)
    np.testing.assert_array_equal(back.sigma, LINKS.sigma)


def test_compliances():
    """Each with its sigma and whether the data see it; read back alike."""
    data = of.deflection_to_dict({"arm": BENDS})
    (back,) = of.deflection_from_dict(data).values()
    assert back.joints == ("a", "b")
    for name in ("rad_per_nm", "sigma", "seen"):
        np.testing.assert_array_equal(getattr(back, name), getattr(BENDS, name))


def test_nothing_is_null():
    """Without robots that are estimated every field is null, and null reads as none."""
    nothing = of.joint_offsets_to_dict({})
    assert len(nothing) == 5
    assert set(nothing.values()) == {None}
    assert of.joint_offsets_from_dict(nothing) == of.joint_offsets_from_dict({}) == {}
    assert of.link_parameters_to_dict({}) is None
    assert of.deflection_to_dict({}) is None
    assert of.link_parameters_from_dict(None) == of.deflection_from_dict(None) == {}


def test_numbers_of_other_shapes_are_refused():
    """As many numbers as joints."""
    data = of.joint_offsets_to_dict({"arm": OFFSETS})
    for key, wrong in (("joint_offsets_rad", [1.0]), ("joint_offsets_covariance", [[1.0]])):
        with pytest.raises(InputError, match=f"{key} has shape"):
            of.joint_offsets_from_dict(data | {key: {"arm": wrong}})
    bends = of.deflection_to_dict({"arm": BENDS})["arm"]
    for key in ("rad_per_nm", "sigma_rad_per_nm"):
        with pytest.raises(InputError, match=f"{key} has shape"):
            of.deflection_from_dict({"arm": bends | {key: [1.0]}})
