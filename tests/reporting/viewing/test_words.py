"""What is said of a sample and of an answer."""

from __future__ import annotations

import re

import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.residuals.without_samples import WithoutSamples, without_samples
from basecal.cell import Residuals, SampleResidual
from basecal.reporting.viewing.words import answer_rows, fit_sentence, sample_words
from basecal.simulation import Scenario, simulate


@pytest.fixture(scope="module")
def made():
    cell = simulate(Scenario(samples=12), 4)
    return cell, calibrate(cell.cell, cell.recording)


def test_views_of_a_sample() -> None:
    """Those of this sample alone, with what is known of them."""
    views = [SampleResidual(1, "wrist", "board", 0.214, 1.5e-3, 0.01), SampleResidual(2, "wrist", "board")]
    loop = "pose consistency error 1.5 mm and 0.57 deg"
    assert sample_words(1, views, ()) == ["sample 1", f"board seen by wrist: reprojection error 0.21 px, {loop}"]
    assert sample_words(2, views, {2}) == ["sample 2, left out", "board seen by wrist: no residual"]


def test_the_answer_beside_the_run(made) -> None:
    """With all samples it is the run's; without some it has moved, and is known less well."""
    cell, calibration = made
    whole = without_samples(cell.cell, cell.recording, calibration, ())
    name, before, after, moved = next(answer_rows(cell.cell, calibration, whole))
    assert name == "eye_base_from_hand_base"
    assert re.fullmatch(r"[\d.]+ mm and [\d.]+ deg", before)
    assert (after, moved) == (before, "")
    less = without_samples(cell.cell, cell.recording, calibration, {2, 3, 4})
    _, _, after, moved = next(answer_rows(cell.cell, calibration, less))
    assert float(after.split()[0]) > float(before.split()[0])
    assert re.fullmatch(r"[\d.]+ mm and [\d.]+ deg", moved)
    assert re.fullmatch(r"reprojection error [\d.]+ px rms; pose consistency error [\d.]+ mm rms\.", fit_sentence(less))


def test_what_is_not_there_is_said(made) -> None:
    """Neither an optimum nor a transform."""
    cell, calibration = made
    nothing = WithoutSamples({}, Residuals(), False)
    assert next(answer_rows(cell.cell, calibration, nothing))[2] == "not every direction of it is seen"
    assert fit_sentence(nothing) == "no optimum was found."
