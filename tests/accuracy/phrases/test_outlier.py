"""Tests of the wording of outlier reasons."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from basecal.accuracy.phrases.outlier import list_outliers, name_sample, outlier_entry, outlier_reason
from basecal.estimation.outliers.left_out import LeftOut


@pytest.mark.parametrize(
    ("of", "words"),
    [
        (LeftOut(3, "wrist", "board", (), 12.3, 0.0161, 0.05), "disagree by 12 sigma, 16 mm and 2.9 deg: a robot"),
        (
            LeftOut(3, "wrist", "led", (), 2e4, off_px=40.4),
            "led is 40 px (more than 1000",
        ),
        (
            LeftOut(3, "depth", "light", (), 12.3, off_m=0.0104),
            "light is 10 mm (12 sigma) from its prediction: another point, or one that moved",
        ),
        (LeftOut(3, "wrist", "led", (), math.nan, off_px=math.nan), "led is far from its prediction: a"),
        (LeftOut(3, "wrist", "board", (4,), 7.2, off_px=1.994), "a point is 2.0 px (7 sigma) from its prediction"),
        (
            LeftOut(3, "wrist", "board", (4, 5), 7.2, off_m=0.0123),
            "2 points are up to 12 mm (7 sigma) from their predictions",
        ),
        (
            LeftOut(3, "wrist", "board", (4,), math.inf, off_px=math.inf),
            "a point is far from its prediction: a",
        ),
    ],
)
def test_reason_states_distance_and_cause(of, words):
    """A reason states distances in px, mm and degrees and sigmas up to a thousand, and no number without one."""
    assert words in outlier_reason(of)


def test_outlier_entry_keeps_place():
    """The entry keeps the sample, camera, target, points and image of the outlier."""
    left_out = LeftOut(3, "wrist", "board", (4, 5), 7.0, off_px=2.0)
    outlier = outlier_entry(left_out, {(3, "wrist"): "images/a.png", (3, "other"): "images/b.png"})
    assert (outlier.sample, outlier.camera, outlier.target, outlier.ids) == (3, "wrist", "board", (4, 5))
    assert outlier.image == "images/a.png"
    assert outlier_entry(left_out, {(4, "wrist"): "images/a.png"}).image is None


def test_sample_is_named_with_image_file():
    """A sample is named with the file name of its image, or by its number alone."""
    assert name_sample(11, "images/cam/IMG_12.png") == "sample 11 (IMG_12.png)"
    assert name_sample(11, None) == "sample 11"


def test_listed_outliers_have_size():
    """The first listed outlier has its cause, the others their size; many refer to calibration.json."""
    view = LeftOut(3, "wrist", "board", (), 12.3, 0.0161, 0.05)
    others = (
        LeftOut(4, "wrist", "board", (1, 2), 7.2, off_px=1.994),
        LeftOut(5, "wrist", "board", (1,), math.nan, off_px=math.nan),
    )
    text = list_outliers((view, *others), {(3, "wrist"): "images/a.png", (5, "wrist"): "images/c.png"})
    assert text.startswith("At sample 3 (a.png), the robots' poses and the view disagree by 12 sigma, 16 mm")
    assert text.endswith(". Sample 4: 2 points, up to 2.0 px (7 sigma). Sample 5 (c.png): far.")
    assert "Sample 4: 16 mm and 2.9 deg (12 sigma)." in list_outliers((view, replace(view, sample=4)), {})
    many = list_outliers([replace(view, sample=k) for k in range(6)], {})
    assert "Sample 4: " in many
    assert "Sample 5" not in many
    assert many.endswith("The others are listed under `outliers` in calibration.json.")


def test_sigmas_above_thousand_have_no_number():
    """Above a thousand sigmas no number is stated, and an outlier without a distance is "far"."""
    assert "disagree by 1000 sigma, " in outlier_reason(LeftOut(3, "a", "b", (), 1000.0, 0.1, 0.1))
    assert "disagree by more than 1000 sigma, " in outlier_reason(LeftOut(3, "a", "b", (), 1000.1, 0.1, 0.1))
    assert outlier_reason(LeftOut(3, "a", "b", (), math.nan)) == (
        "b is far from its prediction: a reflection, or a robot bumped or not settled"
    )
    assert outlier_reason(LeftOut(3, "a", "b", (), math.nan, 0.01, 0.02)) == (
        "the robots' poses and the view disagree, 10 mm and 1.1 deg: a robot bumped or not settled, or poses and "
        "view of different instants"
    )
    assert outlier_reason(LeftOut(3, "a", "b", (1,), math.nan)) == (
        "a point is far from its prediction: a reflection, a wrong id or occlusion"
    )


@pytest.mark.parametrize("count", [1, 4, 5, 6, 9])
def test_five_outliers_are_listed(count):
    """At most five outliers are listed; for more the message states where the others are."""
    view = LeftOut(3, "wrist", "board", (), 12.3, 0.0161, 0.05)
    text = list_outliers([replace(view, sample=k) for k in range(count)], {})
    assert text.lower().count("sample ") == min(count, 5)
    assert ("The others are listed" in text) == (count > 5)
