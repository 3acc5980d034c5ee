"""Samples used of those recorded."""

from __future__ import annotations

from basecal.accuracy.sample_use import SampleUse, outlier_views, sample_use
from basecal.cell import Calibration, Outlier, Recording, Residuals, Sample, SampleResidual


def test_a_sample_counts_while_one_view_of_it_does():
    """Views left out whole are not used, points left out do not matter; a sample without views was recorded."""
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


def test_without_outliers_all_views_are_used():
    """Whether none were looked for or none were found; nothing recorded is nothing used."""
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
