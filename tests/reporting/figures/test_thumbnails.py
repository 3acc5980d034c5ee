"""Tests of the images of the worst views."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from markupsafe import Markup
from tests.drawings import ends
from tests.seen_points import seen

from basecal.cell import Calibration, Recording, Residuals, Sample
from basecal.reporting.figures import thumbnails as thumbnails_module
from basecal.reporting.figures.thumbnails import image_drawing, sample_pictures, thumbnails
from basecal.simulation import Scenario, simulate
from basecal.vision.image_file import write_png

CELL = simulate(Scenario(samples=2), 0).cell
CALIBRATION = Calibration("good", residuals=Residuals(0.2))


def points(*errors_px, left_out=()):
    """Two points per sample with given residuals."""
    made = seen([[300.0, 200.0], [640.0, 360.0]] * len(errors_px), np.repeat(errors_px, 2)[:, None] * [1.0, 0.0])
    sample = np.repeat(np.arange(len(errors_px)), 2)
    return replace(made, sample=sample, used=~np.isin(sample, left_out))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Forty samples that share an image of noise, the worst case for its size."""
    folder = tmp_path_factory.mktemp("cell")
    image = np.random.default_rng(1).integers(0, 255, (720, 1280)).astype(np.uint8)
    write_png(Path(folder) / "a.png", image)
    return Recording(tuple(Sample(k, images={"wrist": "a.png"}) for k in range(40)), folder=str(folder))


def test_worst_views_come_first_and_excluded_last(recording):
    """Views are ordered by their rms, each with its number. Excluded views are last and marked."""
    pictures, caption = thumbnails(CELL, recording, CALIBRATION, [points(0.1, 0.5, 0.3, 9.0, left_out=[3])])
    assert [view.sample[0] for _, view, _ in pictures] == [1, 2, 0, 3]
    assert [words for *_, words in pictures][::3] == ["wrist, 0.35 px rms", "wrist, 6.4 px rms, left out"]
    assert caption.startswith("4 of 4 views.")


def test_points_have_residual_lines(recording):
    """A line from each point has the scale of the caption: 0.5 px of 0.5 px is a twentieth of 360."""
    ((only, _, _),), _ = thumbnails(CELL, recording, CALIBRATION, [points(0.5)])
    x, to_x = map(float, re.search(r'class="off" d="M(\S+) \S+?L(\S+) ', only).groups())
    assert to_x - x == pytest.approx(18, abs=0.11)
    assert x == pytest.approx((300.5) * 360 / 1280, abs=0.06)
    assert re.search(r'href="data:image/jpeg;base64,[A-Za-z0-9+/=]+"', only)


def test_image_without_points_has_no_marks(recording):
    """An image without points of a target, like those of a scene, is drawn without marks."""
    (drawn,) = sample_pictures(CELL, recording, CALIBRATION, (), 3)
    assert "sample 3 seen by wrist" in drawn
    assert 'href="data:image/jpeg;base64,' in drawn
    assert "M" not in "".join(re.findall(r'<path[^>]* d="([^"]*)"', drawn))


def test_total_size_of_images_is_bounded(recording):
    """Of forty views with the largest possible images, as many are shown as stay below a megabyte."""
    pictures, _ = thumbnails(CELL, recording, CALIBRATION, [points(*np.linspace(0.1, 0.9, 40))])
    assert 5 < len(pictures) <= 18
    assert sum(len(svg) for svg, *_ in pictures) < 1e6


@pytest.mark.parametrize(("lacking", "shown"), [(0, True), (1, False)])
def test_image_size_limit_is_inclusive(recording, monkeypatch, lacking, shown):
    """An image of exactly the remaining size is shown, one that is a byte too large is not."""
    one = [points(0.5)]
    (((only, _, _),), _) = thumbnails(CELL, recording, CALIBRATION, one)
    monkeypatch.setattr(thumbnails_module, "_MOST_BYTES", len(only) - lacking)
    assert (thumbnails(CELL, recording, CALIBRATION, one) is not None) == shown


def test_missing_images_are_omitted(recording):
    """There is no thumbnail for a missing file, a recording without images, or one without a folder."""
    gone = replace(recording, samples=(Sample(0, images={"wrist": "gone.png"}), *recording.samples[1:]))
    assert [view.sample[0] for _, view, _ in thumbnails(CELL, gone, CALIBRATION, [points(0.9, 0.1)])[0]] == [1]
    only_gone = replace(gone, samples=gone.samples[:1])
    assert thumbnails(CELL, only_gone, CALIBRATION, [points(0.9)]) is None
    assert thumbnails(CELL, Recording((Sample(0),), folder="."), CALIBRATION, [points(0.9)]) is None
    assert thumbnails(CELL, replace(recording, folder=None), CALIBRATION, [points(0.9)]) is None
    assert thumbnails(CELL, recording, CALIBRATION, []) is None


def test_points_are_drawn_on_the_image():
    """Each point is a dot in the pixels of the drawing."""
    pixels = np.array([[99.5, 199.5], [3.5, 4.5]])
    shown = image_drawing("wrist", b"", (1440, 1080), pixels, 0 * pixels, np.ones(2, dtype=bool))
    assert 'viewBox="0 0 360 270"' in shown
    assert 'class="found" d="M25.0 50.0h0M1.0 1.2h0"' in shown


@pytest.fixture
def no_drawing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Select thumbnails without drawing them."""
    monkeypatch.setattr(thumbnails_module, "_picture", lambda *_: Markup("<svg></svg>"))


@pytest.mark.usefixtures("no_drawing")
def test_number_of_views_is_limited(recording):
    """Eighteen used and six excluded views with the largest rms of their points are shown."""
    found = [points(*np.linspace(0.1, 0.9, 30), left_out=range(20, 30))]
    pictures, caption = thumbnails(CELL, recording, CALIBRATION, found)
    assert [int(view.sample[0]) for _, view, _ in pictures] == [*range(19, 1, -1), *range(29, 23, -1)]
    assert caption.startswith("24 of 30 views.")


@pytest.mark.usefixtures("no_drawing")
@pytest.mark.parametrize(("rms_px", "longest"), [(0.2, "0.5"), (None, "2"), (2.2, "5")])
def test_lines_have_the_scale_of_the_calibration(recording, rms_px, longest):
    """A twentieth of the width is twice the calibration's rms, rounded up.

    Without an rms it is twice the largest of the views.
    """
    calibration = Calibration("good", residuals=Residuals(rms_px))
    _, caption = thumbnails(CELL, recording, calibration, [points(0.1, 1.0)])
    assert f"; {longest} px are drawn as a twentieth" in caption


@pytest.mark.usefixtures("no_drawing")
def test_view_rms_is_per_coordinate_of_used_points(recording):
    """Two points are 3 and 40 px off in one coordinate, of which the second is excluded: the rms is 2.1 px."""
    found = points(3.0)
    both = replace(found, off_px=np.array([[3.0, 0.0], [0.0, 40.0]]), used=np.array([True, False]))
    ((_, _, words),), _ = thumbnails(CELL, recording, CALIBRATION, [both])
    assert words == "wrist, 2.1 px rms"


def test_at_most_300_points_are_drawn():
    """All of 300 and every second of 301 points are drawn.

    The large image of a sample has the same marks as the small one.
    """
    for count, drawn in ((300, 300), (301, 151)):
        pixels = np.column_stack([np.linspace(0, 1000, count), np.full(count, 50.0)])
        found = seen(pixels, np.full((count, 2), 0.1))
        with TemporaryDirectory() as folder:
            write_png(Path(folder) / "a.png", np.full((720, 1280), 90, np.uint8))
            one = Recording((Sample(0, images={"wrist": "a.png"}), Sample(1, images={"wrist": "a.png"})), folder=folder)
            (svg,) = sample_pictures(CELL, one, CALIBRATION, [found], 0)
        assert re.search(r'class="found" d="([^"]*)"', svg)[1].count("M") == drawn


def test_excluded_points_have_no_residual_line():
    """Excluded points have a mark of their own at their position."""
    pixels, offsets = np.array([[99.5, 199.5], [3.5, 4.5]]), np.array([[40.0, -80.0], [400.0, 400.0]])
    svg = image_drawing("wrist", b"", (1440, 1080), pixels, offsets, np.array([True, False]))
    (line,) = ends(svg, "off")
    assert line.tolist() == [[25, 50], [35, 30]]
    assert [each.tolist() for each in ends(svg, "left-out")] == [[[1.0, 1.2], [1.0, 1.2]]]


@pytest.mark.usefixtures("no_drawing")
def test_view_of_single_point_is_drawn(recording):
    """The view of an LED has a single point."""
    one = seen([[300.0, 200.0]], [[0.3, 0.4]])
    ((_, view, words),), _ = thumbnails(CELL, recording, CALIBRATION, [one])
    assert view.sample.tolist() == [0]
    assert words == "wrist, 0.35 px rms"
