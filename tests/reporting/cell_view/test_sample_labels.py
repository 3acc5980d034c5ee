"""Tests of the labels of samples, and of the worst sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import Calibration, Outlier, Residuals, SampleResidual
from basecal.reporting.cell_view.sample_labels import sample_labels, worst_sample

VIEWS = (
    SampleResidual(0, "wrist", "board", 0.1234, 1e-3, np.radians(0.5)),
    SampleResidual(3, "wrist", "board", 0.5),
    SampleResidual(3, "top", "board", None, 2e-3),
    SampleResidual(5, "wrist", "board", 9.0),
)
CALIBRATION = Calibration(
    "good", residuals=Residuals(per_sample=VIEWS), outliers=(Outlier(5, "wrist", "board", (), "bumped"),)
)


def test_every_number_has_its_name_and_unit():
    """Views of a sample follow one another; a sample without views has an empty label."""
    first, third, fourth, fifth = sample_labels([0, 3, 4, 5], CALIBRATION)
    assert first == "board seen by wrist: reprojection error 0.12 px, pose consistency error 1.0 mm and 0.50 deg"
    assert third == "board seen by wrist: reprojection error 0.50 px; board seen by top: pose consistency error 2.0 mm"
    assert fourth == ""
    assert fifth == "board seen by wrist (left out): reprojection error 9.0 px"


def test_worst_sample_is_not_excluded():
    """An excluded view is not the worst, and there is none without residuals."""
    assert worst_sample(CALIBRATION) == 3
    assert worst_sample(Calibration("refused")) is None
    by_loop = replace(CALIBRATION, residuals=Residuals(per_sample=VIEWS[2:3]))
    assert worst_sample(by_loop) == 3


@pytest.mark.parametrize("views", [(), (SampleResidual(0, "wrist", "led"),)])
def test_views_without_residuals_have_a_label(views):
    """A label without numbers is no error."""
    assert len(sample_labels([0], Calibration("good", residuals=Residuals(per_sample=views)))) == 1
