"""Tests of the page of a cell's runs: its contents, its behaviour in a browser, and its requests."""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.fit_details import FitDetails
from basecal.accuracy.residuals.without_samples import WithoutSamples, without_samples
from basecal.cell import Calibration, Cell, Residuals, Robot, SampleResidual
from basecal.geometry import SE3, PoseEstimate
from basecal.reporting.decision.tiles import tiles
from basecal.reporting.statement.verdict import error_text
from basecal.reporting.summary import summary
from basecal.reporting.viewing import page as page_module
from basecal.reporting.viewing.page import ViewPage, answer_rows, fit_sentence, sample_words, serve_view
from basecal.simulation import Scenario, simulate
from shared.browser import CHROMIUM, visit

RUN = "20260102T030405Z"


@pytest.fixture(scope="module")
def view_page() -> ViewPage:
    simulated = simulate(Scenario(samples=12), 4)
    calibration = calibrate(simulated.cell, simulated.recording)
    return ViewPage(simulated.cell, simulated.recording, Path("mycell"), (RUN,), lambda name: calibration)


def test_request_contains_the_whole_selection(view_page: ViewPage) -> None:
    """The server keeps no state of a visitor, so that two boxes clicked at once count as two."""
    page = view_page
    html = page.answer({"run": RUN, "without": "3,7"})
    assert "without 2 samples, 1 sigma" in html
    assert re.findall(r'class="view stranger" data-sample="(\d+)"', html) == ["3", "7"] * 3
    assert "with all samples, 1 sigma" in page.answer({})


def test_sigma_matches_the_report(view_page: ViewPage) -> None:
    """The page, its first tile and the terminal have the same sigma. The page has it before any request."""
    calibration, (name,) = view_page.read(RUN), view_page.cell.requested_transforms
    sigma = error_text(*calibration[name].sigma_norms)
    assert f"{name} to {sigma} (1 sigma, 3-D norm)" in summary(view_page.cell, calibration)
    tile = next(
        each for each in tiles(view_page.cell, view_page.recording, calibration, FitDetails()) if name in each.name
    )
    assert tile.value == sigma.replace(" and ", ", ")
    assert sigma in view_page.page()


def test_invalid_selections_are_ignored(view_page: ViewPage) -> None:
    """Unknown runs and invalid numbers are ignored. It is reported if no sample is left."""
    page = view_page
    html = page.answer({"run": "../../etc", "without": "3,x,,\N{SUPERSCRIPT TWO}," + "9" * 5000})
    assert "without 1 sample, 1 sigma" in html
    assert f"run {RUN}" in html
    everyone = ",".join(str(sample.sample) for sample in view_page.recording.samples)
    assert "no sample is left" in page.answer({"without": everyone})
    assert "sample 99" in page.sample({"number": "99,4"})
    assert "sample 0" in page.sample({})


@pytest.mark.journey
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed: apt-get install chromium")
def test_view_page_in_a_browser(view_page: ViewPage, tmp_path: Path) -> None:
    """The page shows verdict, answer, bars and the first sample.

    It has no console errors and contacts no other host.
    """
    with serve_view(view_page) as address:
        came = visit(address, tmp_path / "profile", selector=".bars .view.chosen")
        assert urlsplit(address).hostname == "127.0.0.1"
    assert came.errors == []
    assert {urlsplit(request).hostname for request in came.requests if not request.startswith("data:")} == {"127.0.0.1"}
    for words in ("GOOD", f"run {RUN}", "eye_base_from_hand_base", "Included samples", "board seen by wrist"):
        assert words in came.words


@pytest.fixture(scope="module")
def calibrated_cell():
    cell = simulate(Scenario(samples=12), 4)
    return cell, calibrate(cell.cell, cell.recording)


def test_sample_words_list_its_views() -> None:
    """Only the views of this sample are listed, with their known residuals."""
    views = [SampleResidual(1, "wrist", "board", 0.214, 1.5e-3, 0.01), SampleResidual(2, "wrist", "board")]
    loop = "pose consistency error 1.5 mm and 0.57 deg"
    assert sample_words(1, views, ()) == ["sample 1", f"board seen by wrist: reprojection error 0.21 px, {loop}"]
    assert sample_words(2, views, {2}) == ["sample 2, left out", "board seen by wrist: no residual"]


def test_answer_without_samples_is_compared_with_run(calibrated_cell) -> None:
    """With all samples the answer is the run's. Without some of them it has moved and is less certain."""
    cell, calibration = calibrated_cell
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


def test_missing_answer_is_reported(calibrated_cell) -> None:
    """A missing transform and a missing optimum are reported."""
    cell, calibration = calibrated_cell
    nothing = WithoutSamples({}, Residuals(), False)
    assert next(answer_rows(cell.cell, calibration, nothing))[2] == "unobservable in some direction"
    assert fit_sentence(nothing) == "no optimum was found."


def test_numbers_have_at_most_fifteen_digits() -> None:
    """Longer numbers, signs and fractions are ignored."""
    long = "9" * 15
    assert page_module._numbers(f"0,12,{long},{long}9,-1,1.5, 3,") == (0, 12, int(long))


def test_answer_rows_handle_unknown_transforms() -> None:
    """The rows have a transform that moved, in mm and deg, one that the run lacks, and one that did not move."""
    cell = Cell("eye", {"eye": Robot("eye"), "hand": Robot("hand")})
    (name,) = cell.requested_transforms
    here = PoseEstimate(SE3.identity(), np.diag([1e-6] * 3 + [1e-6] * 3))
    there = PoseEstimate(SE3.from_rpy((0, 0, np.radians(2)), (0.0, 0.0, 0.0125)), 4 * here.covariance)
    run = Calibration("good", {name: here})
    (row,) = answer_rows(cell, run, WithoutSamples({name: there}, Residuals(), True))
    assert row == (name, "1.7 mm and 0.099 deg", "3.5 mm and 0.20 deg", "12 mm and 2.0 deg")
    (row,) = answer_rows(cell, Calibration("refused"), WithoutSamples({name: there}, Residuals(), True))
    assert row == (name, "unknown", "3.5 mm and 0.20 deg", "")
    (row,) = answer_rows(cell, run, WithoutSamples({name: here}, Residuals(), True))
    assert row[3] == ""


@pytest.mark.parametrize(
    ("residuals", "converged", "sentence"),
    [
        (Residuals(), True, ""),
        (Residuals(0.25), True, "reprojection error 0.25 px rms."),
        (Residuals(loop_rms_m=2e-3), True, "pose consistency error 2.0 mm rms."),
        (Residuals(0.25), False, "reprojection error 0.25 px rms; no optimum was found."),
    ],
)
def test_fit_sentence_states_known_residuals(residuals: Residuals, converged: bool, sentence: str) -> None:
    assert fit_sentence(WithoutSamples({}, residuals, converged)) == sentence
