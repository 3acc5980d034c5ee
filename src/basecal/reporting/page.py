"""A calibration as one HTML file that opens offline."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from datetime import datetime
from operator import attrgetter
from typing import Any

from basecal.accuracy.drift.history import drifts
from basecal.accuracy.fit_details import FitDetails
from basecal.accuracy.phrases.held_out_error import explain_held_out_error
from basecal.accuracy.sample_use import outlier_views
from basecal.cell import Calibration, Cell, PastVerification, Recording, SampleResidual
from basecal.exchange.exporters.exporter import pasteable
from basecal.exchange.urdf import numbers
from basecal.fields.digits import two_digits
from basecal.reporting.cell_view.sample_labels import misfit
from basecal.reporting.cell_view.scene import scene
from basecal.reporting.cell_view.stage import scene_values
from basecal.reporting.decision.outlook import component_figure, outlook_figure, workspace
from basecal.reporting.decision.tiles import check_words, passed_checks, remarks, tiles
from basecal.reporting.drift_text import history_text
from basecal.reporting.figures.bars import QUANTITIES, bar_figure
from basecal.reporting.figures.camera_points import points_by_camera
from basecal.reporting.figures.history import history_figure
from basecal.reporting.figures.image_grid import image_coverage, lens_uncertainty
from basecal.reporting.figures.residual_map import residual_map
from basecal.reporting.figures.rings import orientation_figure, residual_polar
from basecal.reporting.figures.thumbnails import thumbnails
from basecal.reporting.overview import answer_words, cell_words, provenance
from basecal.reporting.statement.verdict import (
    COLOURS,
    headline,
    missed_step,
    requested_estimates,
    sort_by_severity,
    tangent_text,
    task_options,
)
from basecal.reporting.svg import Figure
from basecal.reporting.templates.environment import fill_page
from basecal.reporting.text import (
    estimate_rows,
    lens_parameters,
    robot_blocks,
    sentences,
    status_words,
    transform_rows,
)
from basecal.reporting.transforms import copies

# Functions that the template calls.
_TEMPLATE_FUNCTIONS: dict[str, Any] = {
    function.__name__: function
    for function in (
        component_figure,
        estimate_rows,
        lens_parameters,
        numbers,
        status_words,
        tangent_text,
        task_options,
        transform_rows,
        workspace,
    )
}

_MOST_ROWS = 400
_MOST_BARS = 600
_MOST_BARS_IN_ALL = 2700
_MOST_VERIFICATIONS = 20  # lines about the latest verifications
_FEWEST_BARS = 100


def page(
    cell: Cell,
    recording: Recording,
    calibration: Calibration,
    details: FitDetails | None = None,
    *,
    title: str = "calibration",
    time: datetime | None = None,
    run: str | None = None,
    notes: Sequence[str] = (),
    verifications: Sequence[PastVerification] = (),
    outlook: Sequence[tuple[int, float]] = (),
) -> str:
    """The report of a calibration as a self-contained HTML page without external requests.

    Args:
        cell: The calibrated cell.
        recording: The recording.
        calibration: The calibration.
        details: Details of the fit; None if they are unknown.
        title: Title of the page.
        time: Time of the calibration, UTC.
        run: Name of its run, for texts to paste.
        notes: Notes below the verdict, such as that a file has changed since.
        verifications: Verifications of this run in order of time.
        outlook: Numbers of additional planned samples, with the expected error at the task [m].
    """
    fit_details = FitDetails() if details is None else details
    tolerance_m = calibration.settings.get("tolerance_m")
    recorded = sum(bool(sample.observations) for sample in recording.samples)
    return fill_page(
        "page.html",
        ("templates/copies.js", "templates/page.js"),
        title=title,
        cell_word=shlex.quote(title),
        notes=notes,
        cell=cell,
        calibration=calibration,
        closed_form=fit_details.closed_form,
        **_TEMPLATE_FUNCTIONS,
        overview=(answer_words(cell, time), cell_words(cell)),
        tiles=list(tiles(cell, recording, calibration, fit_details)),
        remarks=list(remarks(calibration, outlook)),
        outlook_figure=outlook_figure(outlook, recorded, tolerance_m) if outlook else None,
        history=history_figure(verifications),
        drift=history_text(verifications, drifts(verifications)).splitlines()[-_MOST_VERIFICATIONS:],
        provenance=provenance(cell, calibration),
        **scene_values(scene(cell, recording.samples, calibration)),
        said=sentences(calibration),
        **_answer(cell, calibration, title, run),
        **_fit(cell, recording, calibration, fit_details),
    )


def _answer(cell: Cell, calibration: Calibration, title: str, run: str | None) -> dict[str, Any]:
    """Template values of the result."""
    texts, requested = pasteable(calibration, cell, run), requested_estimates(cell, calibration)
    first, tolerance = headline(cell, calibration), calibration.tolerance
    findings = sort_by_severity(calibration.findings)
    is_known = tolerance is not None and tolerance.expected_95_m is not None
    return {
        "first": first,
        "colour": COLOURS[first.word],
        "missed_step": missed_step(cell, calibration, shlex.quote(title)) if is_known else "",
        "asked": requested,
        "others": [name for name in calibration.transforms if name not in requested],
        "copies": {name: copies(name, cell, calibration, texts) for name in calibration.transforms},
        "robots": robot_blocks(calibration),
        "findings": [each for each in findings if each.do or each.severity != "info"],
        "notes_found": [each for each in findings if not each.do and each.severity == "info"],
        "explained": check_words(),
        "passed": list(passed_checks(calibration)),
    }


def _fit(cell: Cell, recording: Recording, calibration: Calibration, details: FitDetails) -> dict[str, Any]:
    """Template values of the residuals."""
    by_camera = points_by_camera([each for each in details.points if each.used.any()])
    sized = [(cell.cameras[name].size_px, points) for name, points in by_camera.items()]
    lenses = [lens_uncertainty(name, *lens) for name, lens in calibration.cameras.items()]
    views = calibration.residuals.per_sample
    worst = sorted(views, key=misfit, reverse=True)[:_MOST_ROWS]
    return {
        "thumbnails": thumbnails(cell, recording, calibration, details.points),
        "why_larger": explain_held_out_error(calibration),
        "residual_figures": [(residual_map(*each), residual_polar(each[1])) for each in sized],
        "coverage": [*(image_coverage(*each) for each in sized), *filter(None, lenses)],
        "orientations": [orientation_figure(views) for views in details.views if len(views.sample)],
        "views": _views(calibration),
        "rows": [_row(view) for view in sorted(worst, key=attrgetter("sample", "camera", "target"))],
    }


def _views(calibration: Calibration) -> dict[str, list[Figure]]:
    """Figures of the views of each target by each camera, one for each available quantity."""
    pairs: dict[str, list[SampleResidual]] = {}
    for view in calibration.residuals.per_sample:
        pairs.setdefault(f"{view.target} seen by {view.camera}", []).append(view)
    left_out = outlier_views(calibration)
    # Limit the number of bars in each figure, so that the page stays small.
    most = max(_FEWEST_BARS, min(_MOST_BARS, _MOST_BARS_IN_ALL // max(len(pairs) * len(QUANTITIES), 1)))
    figures = {name: [bar_figure(own, each, most, left_out) for each in QUANTITIES] for name, own in pairs.items()}
    return {name: list(filter(None, of_pair)) for name, of_pair in figures.items() if any(of_pair)}


def _row(view: SampleResidual) -> tuple[str, ...]:
    """Cells of a view in a table."""
    values = (quantity.value(view) for quantity in QUANTITIES)
    shown = ("" if value is None else two_digits(value) for value in values)
    return (str(view.sample), view.camera, view.target, *shown)
