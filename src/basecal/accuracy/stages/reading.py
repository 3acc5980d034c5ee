"""Stages before solving: clocks, units, the problem, and checks of the input."""

from __future__ import annotations

from dataclasses import replace

from basecal.accuracy.axis_shift import calibrate_axis_shift
from basecal.accuracy.clocks.search import search_offsets
from basecal.accuracy.findings.evidence import Input
from basecal.accuracy.findings.registry import INPUT_CHECKS
from basecal.accuracy.input_screening.repeated_views import repeated_views
from basecal.accuracy.input_screening.units import count_searchable_images, impossible_units
from basecal.accuracy.readings.scales import convert_units, estimate_units
from basecal.accuracy.stages.case import Case
from basecal.accuracy.task.task import require_placed_transforms
from basecal.estimation.problem.build import build_problem
from basecal.estimation.streams.streams import recording_streams


def check_task(case: Case) -> Case:
    """Check that a requested transform places something in the reference base, if a task point is stated there.

    Raises:
        InputError: if a task point is stated, but there is no such transform.
    """
    if case.settings.task_point is not None and case.settings.method != "axis-shift":
        require_placed_transforms(case.cell)
    return case


def calibrate_from_scene(case: Case) -> Case:
    """Calibrate from the static scene, if it is requested, or if cell or recording have no other target.

    Raises:
        InputError: if there are no images with poses.
    """
    samples = case.recording.samples
    has_tracks_alone = any(each.tracks for each in samples) and not any(each.observations for each in samples)
    if case.settings.method != "scene" and not case.cell.sees_scene and not has_tracks_alone:
        return case
    # The module reads images, which most calibrations do not need.
    from basecal.accuracy.scene.calibrate_scene import calibrate_scene

    return replace(case, calibration=calibrate_scene(case.cell, case.recording, case.settings), is_ended=True)


def estimate_clocks(case: Case) -> Case:
    """Estimate the clocks of streams, and interpolate the robots' paths accordingly."""
    streams = recording_streams(case.cell, case.recording)
    if streams is None:
        return case
    found = search_offsets(streams, case.settings)
    return replace(case, clocked=found, recording=found.recording)


def measure_units(case: Case) -> Case:
    """Estimate the length unit of poses known up to scale, and convert these to metres."""
    units_m, findings = estimate_units(case.cell, case.recording)
    if findings:
        return case.refuse((*findings, *case.recording.findings))
    return case if not units_m else replace(case, units_m=units_m, recording=convert_units(case.recording, units_m))


def screen_units(case: Case) -> Case:
    """Refuse implausible lengths and angles."""
    units = impossible_units(case.cell, case.recording)
    return case.refuse((*units, *case.recording.findings)) if units else case


def pack_problem(case: Case) -> Case:
    """Convert cell and recording to arrays."""
    problem, dropped = build_problem(case.cell, case.recording)
    problem = problem if case.clocked is None else case.clocked.add_jitter(problem)
    case = case.with_findings((*case.recording.findings, *repeated_views(case.cell, case.recording), *dropped))
    return replace(case, packed=problem)


def check_input(case: Case) -> Case:
    """Refuse insufficient input, and report suspicious input."""
    image_count = count_searchable_images(case.cell, case.recording)
    on_paths = case.clocked is not None
    given = Input(case.problem, case.findings, on_paths, image_count, len(case.units_m))
    case = case.with_findings(finding for check in INPUT_CHECKS for finding in check(given))
    return case.refuse() if case.is_refused else case


def calibrate_by_shifts(case: Case) -> Case:
    """Calibrate with the paper's closed form, if it is requested."""
    if case.settings.method != "axis-shift":
        return case
    found = calibrate_axis_shift(case.cell, case.problem, case.settings, list(case.findings))
    return replace(case, calibration=found, is_ended=True)
