"""Report of a calibration in plain text: the verdict, then numbers and lines to paste."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from basecal.accuracy.phrases.outlier import name_sample
from basecal.accuracy.sample_use import outlier_views
from basecal.accuracy.task.local_fits import FEWEST_SAMPLES
from basecal.cell import Calibration, Cell, Finding, Validation
from basecal.effects.registry import RANDOM_EFFECTS, ROBOT_PARAMETERS
from basecal.errors import check_type, count_text
from basecal.exchange.exports.choice import frame_names
from basecal.exchange.exports.digits import format_decimals
from basecal.exchange.ros2 import static_transform_publisher
from basecal.exchange.urdf import origin_line
from basecal.fields.digits import p_value_text, two_digits
from basecal.geometry import Array, Camera, PoseEstimate
from basecal.geometry.lenses.registry import find_lens
from basecal.reporting.cell_view.sample_labels import is_measured, misfit
from basecal.reporting.statement.verdict import (
    error_text,
    gauge_clause,
    headline,
    held_out_errors,
    requested_estimates,
    shown_decimals,
    sort_by_severity,
)

_INTRINSIC_NAMES = ("fx", "fy", "cx", "cy")
_DISPLAY_UNITS = {"px": (1.0, "px"), "m": (1e3, "mm"), "rad": (1e3, "mrad")}
_SHOWN_IDS = 10
_SHOWN_SOURCES = 3  # sources of a budget in one line


def text_report(cell: Cell, calibration: Calibration) -> str:
    """The report of a calibration, lines joined by newlines.

    Args:
        cell: The calibrated cell, which states requested transforms and frame names for other programs.
        calibration: The calibration.

    Raises:
        InputError: if an argument has a wrong type.
    """
    check_type("cell", cell, Cell)
    check_type("calibration", calibration, Calibration)
    requested = requested_estimates(cell, calibration)
    others = [name for name in calibration.transforms if name not in requested]
    blocks = [[str(headline(cell, calibration))]]
    for name in requested:
        blocks.append(_transform(name, calibration))
        if name not in calibration.points:
            mean, frames = calibration[name].mean, frame_names(cell, name)
            blocks[-1] += ["  URDF:  " + origin_line(mean), "  ROS 2: " + static_transform_publisher(mean, *frames)]
    blocks += [_transform(name, calibration) for name in others]
    for name, (camera, covariance) in calibration.cameras.items():
        blocks.append([f"camera intrinsics of {name}  ({camera.model})"])
        for key, value, sigma, unit in lens_parameters(camera, covariance):
            blocks[-1].append(f"  {key:<3}{value:>13}    sigma {sigma} {unit}".rstrip())
    by_subject = sentences(calibration)
    by_subject["outliers"] = [f"outlier: {sentence}" for sentence in by_subject["outliers"]]
    blocks += [*robot_blocks(calibration), *by_subject.values(), list(_findings(calibration.findings))]
    return "\n\n".join("\n".join(block) for block in blocks if block)


def sentences(calibration: Calibration) -> dict[str, list[str]]:
    """Sentences about a calibration, apart from transforms and findings, by subject, a line each."""
    by_subject = {
        "clocks": clock_sentences(calibration),
        "fit": fit_sentences(calibration),
        "cross_validation": validation_sentences(calibration),
        "outliers": outlier_sentences(calibration),
        "noise": noise_sentences(calibration),
        "task": task_rows(calibration),
    }
    return {subject: list(lines) for subject, lines in by_subject.items()}


def number_row(numbers: Iterable[str]) -> str:
    """Numbers in columns of equal width."""
    return "".join(f" {number:>13}" for number in numbers)


def robot_blocks(calibration: Calibration) -> list[list[str]]:
    """Blocks of lines about robot parameters, one for each kind and robot, with a heading."""
    by_kind = calibration.robot_parameters
    return [
        each.report(robot, values)
        for name, each in ROBOT_PARAMETERS.items()
        for robot, values in by_kind.get(name, {}).items()
    ]


def status_words(name: str, calibration: Calibration) -> str:
    """Status of a transform: fixed, prior or free, and whether it is a point."""
    status = calibration.status.get(name, "free")
    return f"{status}, a point" if name in calibration.points else status


def _transform(name: str, calibration: Calibration) -> list[str]:
    status, verdict = status_words(name, calibration), calibration.verdicts.get(name, calibration.verdict)
    known = "fixed" if status.startswith("fixed") else "estimated"
    lines = [f"{known} transform {name}  ({status}): {verdict}"]
    for what, unit, values, sigmas in transform_rows(name, calibration):
        lines.append(f"  {what:<6}{number_row(values)} {unit}")
        lines += [f"  sigma {number_row(sigmas)} {unit}"] if sigmas else []
    if clause := gauge_clause(name, calibration):
        lines.append(f"  sigma{clause}")
    if name not in calibration.points:
        lines.append(f"  q_xyzw{number_row(format_decimals(calibration[name].mean.quaternion, 9))}")
    return lines


class TransformRow(NamedTuple):
    """Three numbers along x, y, z and their sigmas in one unit, with the digits that the sigmas justify."""

    name: str
    unit: str
    values: list[str]
    sigmas: list[str]


def transform_rows(name: str, calibration: Calibration) -> Iterator[TransformRow]:
    """Rows of the translation and, except for a point, of the angles about fixed x, y, z.

    Sigmas are along the axes of the child; fixed transforms have none.
    """
    is_fixed = calibration.status.get(name) == "fixed"
    return estimate_rows(calibration[name], name in calibration.points, is_fixed)


def estimate_rows(estimate: PoseEstimate, is_point: bool = False, is_fixed: bool = False) -> Iterator[TransformRow]:
    """Rows of the translation and, except for a point, of the rotation of an estimate."""
    halves = [("t", "mm", estimate.mean.translation * 1e3, estimate.sigma_t * 1e3)]
    if not is_point:
        halves.append(("rpy", "deg", np.degrees(estimate.mean.rpy), np.degrees(estimate.sigma_r)))
    for what, unit, values, sigmas in halves:
        known = sigmas[:0] if is_fixed else sigmas
        decimals = shown_decimals(known)
        yield TransformRow(what, unit, format_decimals(values, decimals), format_decimals(known, decimals))


def lens_parameters(camera: Camera, covariance: Array) -> Iterator[tuple[str, str, str, str]]:
    """Name, value, sigma and unit of each lens parameter, in the order of the covariance, rounded by sigma."""
    names = [*_INTRINSIC_NAMES, *find_lens(camera.model, len(camera.distortion)).TERM_NAMES]
    for name, value, sigma in zip(names, camera.parameters, np.sqrt(np.diag(covariance)), strict=False):
        shown = format_decimals([value, sigma], shown_decimals(sigma[None]))
        yield name, shown[0], shown[1], "px" if name in _INTRINSIC_NAMES else ""


def clock_sentences(calibration: Calibration) -> Iterator[str]:
    """Sentences about clock offsets, jitter of stamps and rolling shutters, a line each."""
    for name, clock in calibration.clocks.items():
        sigma = f", sigma {1e3 * clock.sigma_s:.3f} ms" if clock.sigma_s else ""
        yield f"clock of {name}: {1e3 * clock.offset_s:+.3f} ms to be added to its stamps{sigma}"
    for name, noise in calibration.noise.get("clocks", {}).items():
        yield f"stamps of {name} jitter by {1e3 * noise['jitter_s']:.2f} ms (1 sigma)"
    for name, line in calibration.line_times.items():
        sigma = f", sigma {1e6 * line.sigma_s:.3f} us" if line.sigma_s else ""
        yield f"rolling shutter of {name}: {1e6 * line.line_time_s:.3f} us a row{sigma}"


def fit_sentences(calibration: Calibration) -> Iterator[str]:
    """Sentences about the residuals, a line each."""
    residuals = calibration.residuals
    left_out = outlier_views(calibration)
    used = [view for view in residuals.per_sample if view not in left_out and is_measured(view)]
    if residuals.rms_px is not None:
        median = "" if residuals.median_px is None else f", median {two_digits(residuals.median_px)} px"
        yield f"reprojection error {two_digits(residuals.rms_px)} px rms per coordinate{median}"
    if residuals.loop_rms_m is not None:
        error = error_text(residuals.loop_rms_m, residuals.loop_rms_rad)
        closed = sum(view.loop_m is not None for view in used)
        yield f"pose consistency error {error} rms over {count_text(closed, 'view')}"
    if len(residuals.loops) > 1:
        for loop in residuals.loops:
            error = error_text(loop.rms_m, loop.rms_rad)
            yield f"pose consistency error of {' - '.join(loop.path)}: {error} over {count_text(loop.views, 'view')}"
    worst = max(used, key=misfit, default=None)
    if worst is not None and worst.rms_px is not None:
        yield f"worst view: sample {worst.sample} by {worst.camera}, {two_digits(worst.rms_px)} px rms"
    yield from certificate_lines(calibration)


def certificate_lines(calibration: Calibration) -> Iterator[str]:
    """Line about the proof of the global optimum, if it was requested."""
    proof = calibration.certificate
    if proof is not None and proof.is_global:
        yield f"certificate: global optimum proven; relative duality gap of the rotations {proof.gap or 0.0:.1g}"
    elif proof is not None:
        yield f"certificate: not proven: {proof.reason}"


def validation_sentences(calibration: Calibration) -> Iterator[str]:
    """Sentences about the prediction of held-out samples, a line each."""
    validation = calibration.validation
    if validation is None:
        return
    if errors := held_out_errors(validation):
        split = f"{validation.kind}, {count_text(validation.folds, 'fold')}"
        yield f"cross-validation error ({split}), rms: {', '.join(errors)}"
    if validation.base_change is not None:
        yield f"fold spread over predicted sigma: {float(np.sqrt(validation.base_change)):.2f}; 1 if sigmas are correct"
    yield from rival_lines(validation)


def rival_lines(validation: Validation) -> Iterator[str]:
    """Held-out errors of the result and of other methods, a line each."""
    for rival in validation.rivals:
        if rival.target_m is None or rival.target_rad is None:
            yield f"  {rival.name:<18} fails"
        else:
            yield f"  {rival.name:<18}{1e3 * rival.target_m:10.3f} mm {np.degrees(rival.target_rad):9.4f} deg, held out"


def outlier_sentences(calibration: Calibration) -> Iterator[str]:
    """Sentences about excluded points and views, a line each."""
    for outlier in calibration.outliers or ():
        part = f"points {', '.join(map(str, outlier.ids[:_SHOWN_IDS]))}" if outlier.ids else "the whole view"
        more = ", ..." if len(outlier.ids) > _SHOWN_IDS else ""
        subject = f"{name_sample(outlier.sample, outlier.image)}, {outlier.target} by {outlier.camera}"
        yield f"{subject}, {part}{more}: {outlier.reason}"


def noise_sentences(calibration: Calibration) -> Iterator[str]:
    """Sentences about stated and estimated sigmas, a line each."""
    noise = dict(calibration.noise)
    robots, cameras = (noise.pop(key, None) or {} for key in ("robots", "cameras"))
    measured = [_sigma(key, value) for key, value in noise.items() if value is not None and not isinstance(value, dict)]
    if measured:
        yield f"measurement noise, 1 sigma per axis: {', '.join(measured)}"
    for camera, camera_sigmas in cameras.items():
        if camera_sigmas.get("factor") is not None:
            times = f"{two_digits(camera_sigmas['factor'])} times the sigma stated by its detector"
            yield f"pixel noise of {camera}: {two_digits(camera_sigmas['pixel_px'])} px, {times}"
        elif len(cameras) > 1 and camera_sigmas.get("pixel_px") is not None:
            yield f"pixel noise of {camera}: {two_digits(camera_sigmas['pixel_px'])} px"
    for robot, sigmas in robots.items():
        posed = [_sigma(key, value) for key, value in sigmas.items() if key.startswith("sigma_") and value is not None]
        yield f"pose noise of robot {robot}, 1 sigma per axis: {', '.join(posed)}"
        for name, effect in RANDOM_EFFECTS.items():
            if sigmas.get(name) is None:
                continue
            sigma, words = sigmas[name]["sigma"], effect.report.format(**sigmas[name])
            sigma_text = f"{_sigma('t_m', sigma[:3])}, {_sigma('r_rad', sigma[3:])}"
            yield f"error of robot {robot} that is {words}: {sigma_text}"


def task_sentence(calibration: Calibration) -> str:
    """Sentence with the error at the task and its largest sources; empty without a task."""
    if not calibration.budget:
        return ""
    total_mm = 1e3 * sum(entry.rms_m**2 for entry in calibration.budget) ** 0.5
    largest = [f"{entry.source} {100 * entry.share:.0f} %" for entry in calibration.budget[:_SHOWN_SOURCES]]
    return f"error at the task {two_digits(total_mm)} mm rms; shares of its variance: {', '.join(largest)}"


def task_rows(calibration: Calibration) -> Iterator[str]:
    """Lines of the error at the task by source, over the workspace, and of local calibrations."""
    if calibration.budget:
        yield task_sentence(calibration)
        for entry in calibration.budget:
            halved = f"total {two_digits(1e3 * entry.halved_rms_m)} mm if halved"
            yield f"  {two_digits(1e3 * entry.rms_m):>8} mm {100 * entry.share:5.1f} %  {entry.source}; {halved}"
    if calibration.error_map is not None:
        lengths, angles = 1e3 * calibration.error_map.length_95_m, np.degrees(calibration.error_map.angle_95_rad)
        spread = f"{two_digits(lengths.min())} to {two_digits(lengths.max())} mm and {two_digits(angles.max())} deg"
        yield f"over the workspace 95 % of errors of one flange to another are expected below {spread}"
    yield from local_rows(calibration)


def local_rows(calibration: Calibration) -> Iterator[str]:
    """Lines that compare local calibrations of parts of the workspace with the global one.

    A task box always has a line.
    """
    if calibration.local == () and calibration.settings.get("task_box") is not None:
        yield f"in the box: fewer than {FEWEST_SAMPLES} samples or none held out, too few to calibrate it separately"
    for part in calibration.local or ():
        x, y, z = part.centre_m
        subject = f"about {x:.2f} {y:.2f} {z:.2f} m ({count_text(len(part.samples), 'sample')})"
        if part.global_m is None or part.local_m is None:
            yield f"{subject}: the local calibration failed; use the global one"
            continue
        local_mm, global_mm = (two_digits(1e3 * length) for length in (part.local_m, part.global_m))
        errors = f"held-out {local_mm} mm by a local calibration, {global_mm} mm by the global"
        choice = "use the local one there" if part.is_better else "use the global one"
        yield f"{subject}: {errors}; {p_value_text(part.chance)} for such a difference by noise alone; {choice}"


def _sigma(key: str, value: float | Array) -> str:
    """Text of one sigma or three in display units, for a key that ends in `_px`, `_m` or `_rad`."""
    scale, unit = _DISPLAY_UNITS[key.rpartition("_")[2]]
    sigmas = np.atleast_1d(np.array(value, dtype=np.float64))
    shown = sigmas[:1] if np.all(sigmas == sigmas[0]) else sigmas
    return f"{' '.join(two_digits(scale * each) for each in shown)} {unit}"


def _findings(findings: Iterable[Finding]) -> Iterator[str]:
    for finding in sort_by_severity(findings):
        about = f" [{', '.join(finding.about)}]" if finding.about else ""
        yield f"{finding.severity}: {finding.code}{about}"
        yield f"  {finding.what}"
        if finding.why:
            yield f"  {finding.why}"
        yield from (f"  - {each}" for each in finding.do)
