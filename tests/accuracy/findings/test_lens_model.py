"""Tests of the finding `lens-model`."""

from types import SimpleNamespace

import numpy as np

from basecal.accuracy.findings.lens_model import lens_model


def make_structures(moved_mm):
    moved = np.array([1e-3 * moved_mm, 0, 0, 0, 0, 0])
    return (SimpleNamespace(camera="wrist", rms_px=0.31, chance=3e-6, moved=moved),)


def test_lens_model_warns_if_answer_moves(evidence):
    """A lens structure is an info if it moves the answer by half a sigma, a warning at two.

    Sigmas are 1 mm and 1 mrad.
    """
    assert lens_model(evidence(lens_structures=())) == []
    (little,) = lens_model(evidence(lens_structures=make_structures(0.5)))
    (much,) = lens_model(evidence(lens_structures=make_structures(2.0)))
    assert (little.code, little.severity, little.about) == ("lens-model", "info", ("wrist",))
    assert much.severity == "warning"
    assert "0.31 px rms" in much.message
    assert "by up to 2.0 sigma" in much.message


def test_largest_movement_of_requested_transforms_counts(evidence):
    """The largest movement in either direction counts, of requested transforms with columns.

    Without any it is an info.
    """
    made = evidence(lens_structures=make_structures(-2.0))
    made.cell.requested_transforms = ["base", "fixed"]
    (found,) = lens_model(made)
    assert (found.severity, "move the answer by up to 2.0 sigma," in found.message) == ("warning", True)
    made.cell.requested_transforms = ["fixed"]
    (found,) = lens_model(made)
    assert (found.severity, "move the answer by up to 0.0 sigma," in found.message) == ("info", True)
    for moved, severity in ((0.99, "info"), (1.01, "warning")):
        (found,) = lens_model(evidence(lens_structures=make_structures(moved)))
        assert found.severity == severity
    assert found.what == "Residuals of wrist depend on their position in the image: 0.31 px rms."
    assert found.why.startswith("Its lens model cannot represent them (p = 3e-06). They move the answer by up to ")


def test_movement_uses_own_columns(evidence):
    """The movement of a transform uses its own columns; a point has three of them, after those of others."""
    made = evidence(lens_structures=make_structures(0.0))
    made.lens_structures[0].moved = np.array([9.0, 9, 9, 9, 9, 9, 1e-3, -3e-3, 2e-3, 9, 9])
    made.solution.problem.columns = {"other": slice(0, 6), "base": slice(6, 9), "more": slice(9, 11)}
    made.solution.joint_transform_covariance = lambda names: np.diag([1e-6, 4e-6, 1e-6, 0, 0, 0])
    (found,) = lens_model(made)
    assert "move the answer by up to 2.0 sigma," in found.message
