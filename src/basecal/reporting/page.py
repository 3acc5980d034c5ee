"""A calibration as one HTML file that opens offline."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Sequence
from datetime import datetime
from typing import Any

import numpy as np

from basecal.accuracy.closed_form_comparison import ClosedFormComparison
from basecal.accuracy.drift.history import drifts
from basecal.accuracy.fit_details import FitDetails
from basecal.accuracy.phrases.held_out_error import explain_held_out_error
from basecal.accuracy.sample_use import outlier_views
from basecal.cell import Calibration, Cell, PastVerification, Recording, SampleResidual
from basecal.exchange.exporters.exporter import pasteable
from basecal.geometry import Array
from basecal.reporting.cell_view.scene import scene
from basecal.reporting.cell_view.stage import stage
from basecal.reporting.decision.checks import check_words, passed_checks
from basecal.reporting.decision.components import component_figure
from basecal.reporting.decision.outlook import outlook_figure
from basecal.reporting.decision.tiles import remarks, tiles
from basecal.reporting.decision.workspace import workspace
from basecal.reporting.drift_text import history_text
from basecal.reporting.figures.bars import QUANTITIES, bar_figure
from basecal.reporting.figures.camera_points import points_by_camera
from basecal.reporting.figures.figure import Figure
from basecal.reporting.figures.history import history_figure
from basecal.reporting.figures.image_coverage import image_coverage
from basecal.reporting.figures.lens_uncertainty import lens_uncertainty
from basecal.reporting.figures.orientations import orientation_figure
from basecal.reporting.figures.residual_map import residual_map
from basecal.reporting.figures.residual_polar import residual_polar
from basecal.reporting.figures.thumbnails import thumbnails
from basecal.reporting.overview import overview
from basecal.reporting.provenance import provenance
from basecal.reporting.robots import robot_blocks
from basecal.reporting.statement.digits import two_digits
from basecal.reporting.statement.verdict import COLOURS, headline, missed_step, sort_by_severity, task_options
from basecal.reporting.templates.environment import fill_page
from basecal.reporting.text import (
    clock_sentences,
    fit_sentences,
    lens_parameters,
    noise_sentences,
    outlier_sentences,
    task_rows,
    validation_sentences,
)
from basecal.reporting.transforms import transform_view

_MOST_ROWS = 400
_MOST_BARS = 600
_MOST_BARS_IN_ALL = 2700
_MOST_VERIFICATIONS = 20  # lines about verifications, the latest
_FEWEST_BARS = 100
_SHOWN_FINDINGS = 3  # of the first screen
# Of each section that may be there: its place on the page, what fills it, and its name.
_CONTENTS = (
    ("cell", "overview", "Cell"),
    ("closed-form", "closed_form", "Two methods"),
    ("task", "task", "At the task"),
    ("verified", "history", "Verified since"),
    ("residuals", "fit", "Residuals"),
    ("coverage", "orientations", "Coverage"),
    ("validation", "cross_validation", "Cross-validation"),
    ("outliers", "outliers", "Outliers"),
    ("images", "thumbnails", "Images"),
    ("views", "views", "Views"),
    ("transforms", "others", "Other transforms"),
    ("provenance", "provenance", "Provenance"),
)


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
    """The report of a calibration as HTML, everything it needs inside; it asks nothing of any server.

    Args:
        cell: What was calibrated.
        recording: What was seen.
        calibration: What came out.
        details: How the recording fits it; None if that is not known.
        title: What the reader calls it.
        time: When it was calibrated, UTC.
        run: Name of its run, said in what is pasted.
        notes: Said below the verdict, such as that a file has changed since.
        verifications: The verifications of this run, as they were made.
        outlook: What so many planned samples more leave of the error at the task [m].
    """
    drawn = scene(cell, recording.samples, calibration)
    known = FitDetails() if details is None else details
    filled = {
        "overview": overview(cell, time),
        "tiles": list(tiles(cell, recording, calibration, known)),
        "remarks": list(remarks(calibration, outlook)),
        **_answer(cell, calibration, run),
        **_task(recording, calibration, outlook),
        **_fit(cell, recording, calibration, known),
        **_verification_lines(verifications),
        "provenance": provenance(cell, calibration),
    }
    return fill_page(
        "page.html",
        ("templates/copies.js", "templates/page.js"),
        title=title,
        cell_word=shlex.quote(title),
        missed_step=missed_step(cell, calibration, shlex.quote(title)) if _is_missed(calibration) else "",
        notes=notes,
        **stage(drawn),
        contents=[(id, name) for id, key, name in _CONTENTS if filled[key]],
        **filled,
    )


def _verification_lines(verifications: Sequence[PastVerification]) -> dict[str, Any]:
    """Lines of verifications."""
    lines = history_text(verifications, drifts(verifications)).splitlines()
    return {"history": history_figure(verifications), "drift": lines[-_MOST_VERIFICATIONS:]}


def _is_missed(calibration: Calibration) -> bool:
    """Whether an expected error is known, and above the tolerance."""
    tolerance = calibration.tolerance
    return tolerance is not None and tolerance.expected_95_m is not None and not tolerance.is_within


def _answer(cell: Cell, calibration: Calibration, run: str | None) -> dict[str, Any]:
    """The answer, for the template."""
    pasted = pasteable(calibration, cell, run)
    asked = [name for name in cell.requested_transforms if name in calibration.transforms]
    others = [name for name in calibration.transforms if name not in asked]
    first, tolerance = headline(cell, calibration), calibration.tolerance
    found = sort_by_severity(calibration.findings)
    free = [name for name in asked if calibration.status.get(name) != "fixed"]
    asked_m = None if tolerance is None else tolerance.asked_m
    return {
        "verdict": calibration.verdict,
        "first": first,
        "colour": COLOURS[first.word],
        "asked": [transform_view(name, cell, calibration, pasted) for name in asked],
        "components": {
            name: component_figure(name.partition("_from_")[2], calibration[name], asked_m) for name in free
        },
        "lacking": [name for name in cell.requested_transforms if name not in calibration.transforms],
        "others": [transform_view(name, cell, calibration, pasted) for name in others],
        "lenses": [
            (name, camera.model, lens_parameters(camera, c)) for name, (camera, c) in calibration.cameras.items()
        ],
        "robots": [(heading, "\n".join(lines)) for heading, *lines in robot_blocks(calibration)],
        "findings": [each for each in found if each.do or each.severity != "info"],
        "notes_found": [each for each in found if not each.do and each.severity == "info"],
        "shown": _SHOWN_FINDINGS,
        "explained": check_words(),
        "passed": list(passed_checks(calibration)),
        "unobservable": calibration.unobservable,
    }


def _task(recording: Recording, calibration: Calibration, outlook: Sequence[tuple[int, float]]) -> dict[str, Any]:
    """The error at the task, for the template."""
    tolerance_m = calibration.settings.get("tolerance_m")
    recorded = sum(bool(sample.observations) for sample in recording.samples)
    return {
        "task": list(task_rows(calibration)),
        "budget": calibration.budget or (),
        "outlook_figure": outlook_figure(outlook, recorded, tolerance_m) if outlook else None,
        # What `basecal plan` is asked for more samples.
        "task_options": task_options(calibration),
        "workspace": [] if calibration.error_map is None else list(workspace(calibration.error_map)),
    }


def _closed_form(comparison: ClosedFormComparison) -> dict[str, Any]:
    """Two methods beside each other, and each station, for the template; lengths in mm, angles in deg."""
    both = {"closed form of the paper": comparison.estimate, "maximum likelihood": comparison.other}
    return {
        "name": comparison.name,
        "methods": [
            (how, 1e3 * each.mean.translation, np.degrees(each.mean.rpy), _lengths(each.sigma_t, each.sigma_r))
            for how, each in both.items()
        ],
        "apart": _lengths(*np.split(comparison.difference, 2)),
        "stations": [
            (station, 1e3 * station.light, _lengths(*np.split(station.off, 2))) for station in comparison.stations
        ],
        "most": max(station.weight for station in comparison.stations),
    }


def _lengths(t: Array, r: Array) -> tuple[str, ...]:
    """Lengths of a translation [mm] and a rotation [deg]."""
    return two_digits(1e3 * float(np.linalg.norm(t))), two_digits(float(np.degrees(np.linalg.norm(r))))


def _fit(cell: Cell, recording: Recording, calibration: Calibration, details: FitDetails) -> dict[str, Any]:
    """How everything fits, for the template."""
    seen = [each for each in details.points if each.used.any()]
    sized = [(cell.cameras[name].size_px, of) for name, of in points_by_camera(seen).items()]
    views = calibration.residuals.per_sample
    return {
        "fit": [*fit_sentences(calibration), *noise_sentences(calibration), *clock_sentences(calibration)],
        "thumbnails": thumbnails(cell, recording, calibration, details.points),
        "closed_form": None if details.closed_form is None else _closed_form(details.closed_form),
        "cross_validation": list(validation_sentences(calibration)),
        "why_larger": explain_held_out_error(calibration),
        "outliers": list(outlier_sentences(calibration)),
        "maps": [residual_map(*each) for each in sized],
        "polars": [residual_polar(of) for _, of in sized],
        "coverage": [image_coverage(*each) for each in sized],
        "lens_uncertainty": [
            figure for name, lens in calibration.cameras.items() if (figure := lens_uncertainty(name, *lens))
        ],
        "orientations": [orientation_figure(views) for views in details.views if len(views.sample)],
        "views": _views(views, outlier_views(calibration)),
        "rows": _worst_rows(views),
        "view_count": len(views),
    }


def _views(views: Sequence[SampleResidual], exclusions: Collection[SampleResidual]) -> list[tuple[str, list[Figure]]]:
    """The views of each target by each camera: their name, a figure for each quantity there is."""
    pairs = dict.fromkeys((view.camera, view.target) for view in views)
    # So many in each figure that the page stays small.
    figure_count = max(len(pairs) * len(QUANTITIES), 1)
    most = max(_FEWEST_BARS, min(_MOST_BARS, _MOST_BARS_IN_ALL // figure_count))
    shown = []
    for camera, target in pairs:
        own = [view for view in views if (view.camera, view.target) == (camera, target)]
        figures = [f for quantity in QUANTITIES if (f := bar_figure(own, quantity, most, exclusions)) is not None]
        shown.append((f"{target} seen by {camera}", figures))
    return [each for each in shown if each[1]]


def _worst_rows(views: Sequence[SampleResidual]) -> list[tuple[str, ...]]:
    """Cells of a table of views in the order of samples, of many those that fit worst."""
    worst = sorted(views, key=lambda view: (view.rms_px or 0.0, view.loop_m or 0.0), reverse=True)[:_MOST_ROWS]
    ordered = sorted(worst, key=lambda view: (view.sample, view.camera, view.target))
    rows = []
    for view in ordered:
        values = [(getattr(view, quantity.field), quantity.factor) for quantity in QUANTITIES]
        shown = ("" if value is None else two_digits(value * factor) for value, factor in values)
        rows.append((str(view.sample), view.camera, view.target, *shown))
    return rows
