"""The verdict of a calibration for all outputs: one word, and one sentence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from basecal.cell import Calibration, Cell, Finding, Tolerance, Validation
from basecal.cell.work_error import PlaceKind
from basecal.errors import count_text
from basecal.fields.digits import two_digit_decimals, two_digits
from basecal.geometry import Array, PoseEstimate

Word = Literal["PASS", "FAIL", "GOOD", "DOUBTFUL", "REFUSED"]

COLOURS = {"PASS": "good", "GOOD": "good", "DOUBTFUL": "doubtful", "FAIL": "refused", "REFUSED": "refused"}
"""Colour of each word, as the name of a verdict."""

PLACE_WORDS: Mapping[PlaceKind, str] = {
    "task point": "at the task point",
    "task box": "in the task box",
    "recorded places": "where the arms worked",
}
"""Text for the positions at which an error is expected."""

_SEVERITY_RANK = {"error": 0, "warning": 1, "info": 2}
# Findings that are consequences of others are listed after them.
_CONSEQUENCE_CODES = ("poor-fit", "inconsistent-folds", "overfit", "weak-direction", "not-converged", "too-few-samples")
# Causes of too few samples are listed before the finding of too few samples.
_LOSS_CODES = ("few-images", "dropped-sample")
_EXACT_DECIMALS = 4  # of mm and deg, for exact values


@dataclass(frozen=True)
class Headline:
    """The verdict in one word, a sentence about the accuracy, and the reason for doubt, if any."""

    word: Word
    sentence: str
    doubt: str = ""

    def __str__(self) -> str:
        joint = ", but" if self.word == "DOUBTFUL" else "; doubtful"
        return f"{self.word}: {self.sentence}" + (f"{joint}: {self.doubt}" if self.doubt else "")


def verdict_word(calibration: Calibration) -> Word:
    """`REFUSED`, else `PASS` or `FAIL` if a tolerance is stated, else the verdict.

    A doubtful calibration within its tolerance proves nothing, and is `DOUBTFUL`.
    """
    tolerance = calibration.tolerance
    if calibration.verdict == "refused":
        return "REFUSED"
    if tolerance is not None and not tolerance.is_within:
        return "FAIL"
    if calibration.verdict == "doubtful":
        return "DOUBTFUL"
    return "GOOD" if tolerance is None else "PASS"


def task_options(calibration: Calibration) -> str:
    """Options of `basecal plan` for the task of a calibration; empty without a task."""
    for name in ("task_box", "task_point"):
        numbers = calibration.settings.get(name)
        if numbers is not None:
            return f" --{name.replace('_', '-')} {' '.join(f'{x:g}' for x in numbers)}"
    return ""


def missed_step(cell: Cell, calibration: Calibration, quoted_folder: str) -> str:
    """The next step if the error exceeds the tolerance: a plan, or more images of a scene.

    Args:
        cell: The calibrated cell.
        calibration: The calibration.
        quoted_folder: Folder of the cell, quoted for a shell.
    """
    if calibration.settings.get("method") != "scene":
        assert calibration.tolerance is not None
        tolerance = _tolerance_text(calibration.tolerance.asked_m)
        return f"basecal plan {quoted_folder} --tolerance {tolerance}{task_options(calibration)} -o plan.jsonl"
    drivers = [robot.driver for robot in cell.robots.values()] + [camera.driver for camera in cell.cameras.values()]
    if cell.sees_scene and all(drivers):
        return f"basecal capture {quoted_folder} --freedrive"
    return f"import more images of each arm, then {calibrate_command(cell, calibration, quoted_folder)}"


def calibrate_command(cell: Cell, calibration: Calibration, quoted_folder: str) -> str:
    """The command that repeats a calibration with its settings."""
    settings, method = calibration.settings, ""
    if settings.get("method") == "scene":
        method = "" if cell.sees_scene else " --scene"
    elif settings.get("method") == "axis-shift":
        method = " --method axis-shift"
    also = " --scene also" if settings.get("joins_scene") else ""
    tolerance_m = settings.get("tolerance_m")
    tolerance = "" if tolerance_m is None else f" --tolerance {_tolerance_text(tolerance_m)}"
    return f"basecal calibrate {quoted_folder}{method}{also}{task_options(calibration)}{tolerance}"


def _tolerance_text(tolerance_m: float) -> str:
    return f"{1e3 * tolerance_m:g}mm"


def headline(cell: Cell, calibration: Calibration) -> Headline:
    """The headline of a calibration: accuracy of the requested transforms, or the reason for refusal."""
    word, reason = verdict_word(calibration), _first_reason(calibration.findings)
    if word == "REFUSED":
        return Headline(word, reason or "the requested transforms are unobservable.")
    tolerance = calibration.tolerance
    answer = _answer(cell, calibration) if tolerance is None else tolerance_sentence(tolerance)
    if calibration.verdict == "doubtful":
        return Headline(word, answer, reason)
    return Headline(word, answer if tolerance else f"{answer}.")


def tolerance_sentence(check: Tolerance) -> str:
    """Sentence with the expected error and the tolerance."""
    needed = f"tolerance {1e3 * check.asked_m:g} mm"
    if check.expected_95_m is None:
        return f"a requested transform is unknown, {needed}"
    return f"expected error {two_digits(1e3 * check.expected_95_m)} mm (95 %), {needed}"


def transform_sentence(name: str, calibration: Calibration) -> str:
    """Sentence with the sigma of a transform."""
    sigma = _sigma_text(name, calibration, calibration[name])
    return f"{name} to {sigma} (1 sigma, 3-D norm){gauge_clause(name, calibration)}"


def gauge_clause(name: str, calibration: Calibration) -> str:
    """Clause with the part of a transform's sigma due to a gauge, and the fixed parameters; empty if there is none."""
    covariances = calibration.gauge_covariances(name)
    if not covariances:
        return ""
    kinds = {
        kind.replace("_", " ")
        for gauge in calibration.gauges
        if gauge.robot in covariances
        for kind in gauge.parameters
    }
    part = _sigma_text(
        name, calibration, PoseEstimate(calibration[name].mean, sum(covariances.values(), np.zeros((6, 6))))
    )
    return f", of which {part} by the gauge that holds {' and '.join(sorted(kinds))} of {' and '.join(covariances)}"


def _sigma_text(name: str, calibration: Calibration, estimate: PoseEstimate) -> str:
    sigma_m, sigma_rad = estimate.sigma_norms
    return error_text(sigma_m, None if name in calibration.points else sigma_rad)


def error_text(length_m: float, angle_rad: float | None) -> str:
    """Text of a length in mm and, if given, an angle in degrees."""
    angle = "" if angle_rad is None else f" and {two_digits(float(np.degrees(angle_rad)))} deg"
    return f"{two_digits(1e3 * length_m)} mm{angle}"


def tangent_text(tangent: Array) -> str:
    """Text of the translation and rotation of a tangent, (6,) [m, rad], as lengths."""
    return error_text(*(float(np.linalg.norm(half)) for half in np.split(tangent, 2)))


def requested_estimates(cell: Cell, calibration: Calibration) -> list[str]:
    """Names of the requested transforms that were found."""
    return [name for name in cell.requested_transforms if name in calibration.transforms]


def held_out_errors(validation: Validation | None) -> list[str]:
    """Texts of the prediction errors of held-out samples: at the target, and in the image."""
    if validation is None:
        return []
    errors = []
    if validation.target_m is not None and validation.target_rad is not None:
        errors.append(f"{error_text(validation.target_m, validation.target_rad)} at the target")
    if validation.rms_px is not None:
        errors.append(f"{two_digits(validation.rms_px)} px")
    return errors


def sort_by_severity(findings: Iterable[Finding]) -> list[Finding]:
    """Sort findings: errors, warnings, infos; consequences of other findings last within each."""
    unsorted = list(findings)
    too_few = any(f.code == "too-few-samples" for f in unsorted)

    def weight(f: Finding) -> tuple[int, bool]:
        """Sort key of a finding."""
        is_cause = too_few and f.severity == "warning" and f.code in _LOSS_CODES
        return _SEVERITY_RANK["error" if is_cause else f.severity], f.code in _CONSEQUENCE_CODES

    return sorted(unsorted, key=weight)


def _answer(cell: Cell, calibration: Calibration) -> str:
    if at_work := work_sentences(calibration):
        return at_work[0]
    known = (transform_sentence(name, calibration) for name in requested_estimates(cell, calibration))
    answer = "; ".join(known) or "no transform is requested, all are fixed"
    errors = held_out_errors(calibration.validation)[:1]
    return "; ".join([answer, *(f"cross-validation error, rms: {error}" for error in errors)])


def work_sentences(calibration: Calibration) -> list[str]:
    """Sentences with the expected error between flanges; empty if no robots are related."""
    meeting = calibration.meeting
    if meeting is None:
        return []
    return [f"expected error {two_digits(1e3 * meeting.expected_95_m)} mm (95 %) {PLACE_WORDS[meeting.where]}"]


def _first_reason(findings: Iterable[Finding]) -> str:
    """The most important finding, and the number of other errors and warnings."""
    messages = [f.what for f in sort_by_severity(findings) if f.severity != "info"]
    if len(messages) < 2:
        return "".join(messages)
    others = len(messages) - 1
    return f"{messages[0].rstrip('.')} (and {count_text(others, 'more finding')})"


def shown_decimals(sigmas: Array) -> int:
    """Decimals with which the smallest sigma has two significant digits; those of an exact value if all are zero."""
    uncertain = sigmas[sigmas > 0]
    return _EXACT_DECIMALS if len(uncertain) == 0 else two_digit_decimals(float(uncertain.min()))
