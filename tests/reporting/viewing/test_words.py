"""What is said of a sample and of an answer."""

from __future__ import annotations

import re

import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.residuals.without_samples import WithoutSamples, without_samples
from basecal.cell import Residuals, SampleResidual
from basecal.reporting.viewing.words import answer_words, sample_words
from basecal.simulation import Scenario, simulate


@pytest.fixture(scope="module")
def made():
    cell = simulate(Scenario(samples=12), 4)
    return cell, calibrate(cell.cell, cell.recording)


def test_views_of_a_sample() -> None:
    """Those of this sample alone, with what is known of them."""
    views = [SampleResidual(1, "wrist", "board", 0.214, 1.5e-3, 0.01), SampleResidual(2, "wrist", "board")]
    assert sample_words(1, views, ()) == "sample 1\nboard seen by wrist: 0.21 px, 1.5 mm and 0.57 deg"
    assert sample_words(2, views, {2}) == "sample 2, left out\nboard seen by wrist: no residual"


def test_the_answer_beside_the_run(made) -> None:
    """With all samples it is the run's; without some it says how many, and how far it is."""
    cell, calibration = made
    whole = without_samples(cell.cell, cell.recording, calibration, ())
    first, base, *_ = answer_words(cell.cell, calibration, whole, ()).splitlines()
    assert first == "run: good; with all samples"
    assert re.match(r"eye_base_from_hand_base to [\d.]+ mm and [\d.]+ deg \(1 sigma\); ", base)
    assert base.endswith("0 mm and 0 deg from the run")
    less = without_samples(cell.cell, cell.recording, calibration, {2})
    first, base, *_ = answer_words(cell.cell, calibration, less, {2}).splitlines()
    assert first == "run: good; without 1 sample"
    assert not base.endswith("0 mm and 0 deg from the run")


def test_what_is_not_there_is_said(made) -> None:
    """Neither an optimum nor a transform."""
    cell, calibration = made
    words = answer_words(cell.cell, calibration, WithoutSamples({}, Residuals(), False), {1, 2})
    assert "without 2 samples: no optimum was found" in words
    assert "eye_base_from_hand_base: not every direction of it is seen" in words
