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


@pytest.mark.parametrize("ends", [(False, False), (True, False), (False, True), (True, True)])
def test_free_offsets_leave_out_what_the_ends_take_up(ends):
    """The first joint turns the arm as its free base does, the last as free mounts do; a prior keeps all."""
    free = of.columns(six_axis(), of.Stated(status="free"), ends, ())
    kept = [row for row in range(6) if not ((row == 0 and ends[0]) or (row == 5 and ends[1]))]
    np.testing.assert_array_equal(free.basis, np.eye(6)[:, kept])
    assert free.sigma is None
    prior = of.columns(six_axis(), of.Stated(status="prior", sigma_rad=0.01), ends, ())
    np.testing.assert_array_equal(prior.basis, np.eye(6))
    assert prior.sigma.tolist() == [0.01] * 6


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
    ends = of.unobserved("joints 1 (a) and 3 (c)", [0, 2], 3, "eye_base", True)
    assert ends.endswith(
        "joints 1 (a) and 3 (c): the first joint moves the arm as its base does, the last one as the mounts on its "
        "flange do; the sigmas of eye_base and of the mounts contain what they leave open"
    )
    middle = of.unobserved("joint 2 (b)", [1], 3, "eye_base", False)
    assert "fixed at zero as a gauge: joint 2 (b): the samples hardly move the others by themselves;" in middle
