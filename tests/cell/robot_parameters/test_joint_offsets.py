"""Joint offsets: columns, what is said of them, and their fields in `calibration.json`."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell import RobotParameters
from basecal.cell.robot_parameters import joint_offsets as of
from basecal.errors import InputError
from basecal.simulation.arms import six_axis

COVARIANCE = np.diag([4.0, 9.0])
FOUND = RobotParameters(("a", "b"), np.array([0.1, 0.2]), np.array([2.0, 3.0]), np.array([True, False]), COVARIANCE)


@pytest.mark.parametrize(("stated", "sigma"), [({"status": "free"}, None), ({"sigma_rad": 0.01}, [0.01] * 6)])
def test_a_column_a_joint(stated, sigma):
    """A radian each, with the prior's sigma where there is one."""
    columns = of.columns(six_axis(), of.Stated(**{"status": "prior", **stated}))
    np.testing.assert_array_equal(columns.basis, np.eye(6))
    assert (columns.sigma if sigma is None else columns.sigma.tolist()) == sigma


def test_fields_of_the_calibration():
    """A field for each number, by robot; read back alike."""
    data = of.to_dict({"arm": FOUND})
    assert data["joint_offsets_rad"]["arm"].tolist() == [0.1, 0.2]
    assert data["joint_offsets_sigma_rad"]["arm"].tolist() == [2.0, 3.0]
    assert data["joint_names"] == {"arm": ("a", "b")}
    (back,) = of.from_dict(data).values()
    assert back.joints == ("a", "b")
    for name in ("values", "sigma", "seen", "covariance"):
        np.testing.assert_array_equal(getattr(back, name), getattr(FOUND, name))


def test_nothing_is_null():
    """Without robots every field is null, and null reads as none."""
    nothing = of.to_dict({})
    assert len(nothing) == 5
    assert set(nothing.values()) == {None}
    assert of.from_dict(nothing) == of.from_dict({}) == {}


@pytest.mark.parametrize(("key", "wrong"), [("joint_offsets_rad", [1.0]), ("joint_offsets_covariance", [[1.0]])])
def test_numbers_of_other_shapes_are_refused(key, wrong):
    """As many numbers as joints."""
    with pytest.raises(InputError, match=f"{key} has shape"):
        of.from_dict(of.to_dict({"arm": FOUND}) | {key: {"arm": wrong}})


def test_why_an_offset_is_not_seen():
    """The ends by what they hang on, the others by how little they move; and what makes up for them."""
    ends = of.unobserved("joints 1 (a) and 4 (d)", [0, 3], 4, "eye_base", True)
    assert ends.endswith(
        "joints 1 (a) and 4 (d): the first joint moves the arm as its base does, the last one as the mounts on its "
        "flange do; the sigmas of eye_base and of the mounts contain what they leave open"
    )
    middle = of.unobserved("joint 2 (b)", [1], 4, "eye_base", False)
    assert "fixed at zero as a gauge: joint 2 (b): the samples hardly move the others by themselves;" in middle
    chained = of.unobserved("joints 1 (a), 2 (b) and 4 (d)", [0, 1, 3], 4, "eye_base", False)
    assert "joints 1 to 2 move the arm as its base does, in these samples, the last one as the mounts" in chained
