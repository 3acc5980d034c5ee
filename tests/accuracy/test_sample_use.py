"""Tests of `sample_use`: samples used of those recorded."""

from __future__ import annotations

from basecal.accuracy.sample_use import SampleUse, outlier_views, sample_use
from basecal.cell import Calibration, Outlier, Recording, Residuals, Sample, SampleResidual


def test_sample_with_one_used_view_counts():
    """A sample counts as used if one view of it is.

    Left-out points do not matter, and a sample without views was recorded.
    """
    views = tuple(SampleResidual(k, camera, "board", 0.2) for k in range(4) for camera in ("left", "right"))
    outliers = (
        Outlier(0, "left", "board", (), "bumped"),
        Outlier(1, "left", "board", (), "bumped"),
        Outlier(1, "right", "board", (), "bumped"),
        Outlier(2, "left", "board", (4,), "reflection"),
    )
    recording = Recording(tuple(map(Sample, range(5))))
    calibration = Calibration("good", residuals=Residuals(per_sample=views), outliers=outliers)
    assert sample_use(recording, calibration) == SampleUse(used=3, recorded=5, views=8)


def test_all_views_are_used_without_outliers():
    """All views are used if outliers were not searched or not found; an empty recording uses none."""
    views = (SampleResidual(3, "left", "board", 0.2), SampleResidual(3, "left", "tag", 0.2))
    for outliers in (None, ()):
        calibration = Calibration("good", residuals=Residuals(per_sample=views), outliers=outliers)
        assert outlier_views(calibration) == frozenset()
        assert sample_use(Recording((Sample(3),)), calibration) == SampleUse(1, 1, 2)
    tag = (Outlier(3, "left", "tag", (), "bumped"), Outlier(4, "left", "board", (), "bumped"))
    calibration = Calibration("good", residuals=Residuals(per_sample=views), outliers=tag)
    assert outlier_views(calibration) == {views[1]}
    assert sample_use(Recording((Sample(3),)), calibration) == SampleUse(1, 1, 2)
    assert sample_use(Recording(), Calibration("good")) == SampleUse(0, 0, 0)
