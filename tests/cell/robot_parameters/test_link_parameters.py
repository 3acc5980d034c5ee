"""Link parameters: their gauges, and their fields in `calibration.json`."""

from __future__ import annotations

import numpy as np

from basecal.cell import RobotParameters
from basecal.cell.robot_parameters import link_parameters as of

SEEN = np.ones((3, 6), dtype=bool)
FOUND = RobotParameters((), np.arange(18.0).reshape(3, 6), np.arange(18.0, 36.0).reshape(3, 6), SEEN)


def test_shifts_and_turns_along_an_axis_pass_through_the_joint(arm, joints):
    """Without free ends the gauges, two a joint, move no flange at any joints."""
    gauges = of.link_gauges(arm, (False, False), with_offsets=False)
    assert np.linalg.matrix_rank(gauges) == 12
    np.testing.assert_allclose(arm.link_jacobian(joints) @ gauges, 0, atol=1e-12)


def test_what_a_free_base_and_mounts_take_up_is_no_link_error(arm, joints):
    """With free ends the 18 columns left and the two transforms span all that the 42 and the transforms do."""
    basis, sigma = of.columns(arm, of.Stated(status="free"), (True, True), ())
    links = arm.link_jacobian(joints)
    poses = arm.forward(joints)
    ends = np.concatenate([poses.inverse().adjoint(), np.broadcast_to(np.eye(6), (30, 6, 6))], -1)
    kept = np.concatenate([links @ basis, ends], -1).reshape(180, -1)
    every = np.concatenate([links, ends], -1).reshape(180, -1)
    assert (basis.shape, sigma) == ((42, 18), None)
    assert np.linalg.matrix_rank(kept) == 30 == np.linalg.matrix_rank(every)


def test_offsets_beside_them_take_up_turns_about_the_axes(arm):
    """One column less a joint but for those that the free ends took up already."""
    alone, beside = (of.columns(arm, of.Stated(status="free"), (True, True), b).basis for b in ((), {"joint_offsets"}))
    assert alone.shape[1] - beside.shape[1] == 4


def test_a_prior_holds_every_tangent(arm):
    """Translations [m] before rotations [rad]."""
    basis, sigma = of.columns(arm, of.Stated(status="prior", sigma_m=0.1, sigma_rad=0.2), (True, True), ())
    np.testing.assert_array_equal(basis, np.eye(42))
    np.testing.assert_array_equal(sigma.reshape(7, 6), [[0.1] * 3 + [0.2] * 3] * 7)


def test_fields_of_the_calibration():
    """Translations before rotations, with their sigmas; read back alike, nothing being null."""
    entry = of.to_dict({"arm": FOUND})["link_parameters"]["arm"]
    assert entry["t_m"].tolist() == [[0, 1, 2], [6, 7, 8], [12, 13, 14]]
    assert entry["r_rad"][0].tolist() == [3, 4, 5]
    assert entry["sigma_t_m"][0].tolist() == [18, 19, 20]
    (back,) = of.from_dict({"link_parameters": {"arm": entry}}).values()
    for name in ("values", "sigma", "seen"):
        np.testing.assert_array_equal(getattr(back, name), getattr(FOUND, name))
    assert of.to_dict({}) == {"link_parameters": None}
    assert of.from_dict({"link_parameters": None}) == {}
