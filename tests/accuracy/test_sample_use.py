"""Samples used of those recorded."""

from __future__ import annotations

from basecal.accuracy.sample_use import SampleUse, sample_use
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
