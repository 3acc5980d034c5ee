"""Text and JSON of a verification and a comparison."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from basecal.accuracy.compare import Comparison
from basecal.accuracy.drift.history import Drift
from basecal.accuracy.drift.shifts import Shift
from basecal.accuracy.drift.verify import POWER, Verification
from basecal.accuracy.model_comparison.nested_models import MOVED_LEVEL
from basecal.cell import PastVerification
from basecal.effects.faces.effect import format_tangent, format_with_sigma
from basecal.errors import count_text
from basecal.fields.digits import p_value_text, two_digits
from basecal.reporting.statement.verdict import error_text

_TIME_FORMAT = "%Y-%m-%d %H:%M"
_SHOWN_SAMPLES = 6  # left-out samples that are listed


def verification_dict(verification: Verification) -> dict[str, Any]:
    """One JSON object; lengths in mm, angles in degrees, null if nothing can be determined."""
    shift = verification.shift if verification.moved else None
    return {
        "moved": verification.moved,
        "frame": shift and shift.frame,
        "transform": (shift and shift.transform) or None,
        "joint": None if shift is None or shift.joint is None else shift.joint + 1,
        "shift_mm": shift and _mm(shift.shift_m),
        "shift_deg": shift and math.degrees(shift.shift_rad),
        "alike": [_frame_or_joint(other) for other in verification.alternatives],
        "p": verification.chance,
        "detectable_mm": _mm(verification.detectable_m),
        "power": POWER,
        "samples": list(verification.samples),
        "outliers": list(verification.outliers),
    }


def _mm(length_m: float | None) -> float | None:
    return None if length_m is None else 1e3 * length_m


def verification_text(verification: Verification) -> str:
    """Lines joined by newlines: whether something moved, what, by how much, and the smallest detectable shift."""
    count = count_text(len(verification.samples), "sample")
    is_single = len(verification.samples) == 1
    if verification.moved is None or verification.shift is None:
        lines = [
            "UNDECIDED: these samples do not show whether anything moved. Take more samples of the calibrated "
            "targets, with both arms rotated, or calibrate from more samples first."
        ]
    elif not verification.moved:
        lines = [f"NOT MOVED: {count} {'agrees' if is_single else 'agree'} with the calibration"]
    else:
        likeliest = _shift_sentence(verification.shift)
        verb = "is" if is_single else "are"
        lines = [f"MOVED: {count} {verb} not explained ({p_value_text(verification.chance)}); most likely {likeliest}"]
        if verification.alternatives:
            others = ", ".join(_frame_or_joint(other) for other in verification.alternatives)
            lines.append(f"as likely, or nearly: {others}; samples with other rotations of both arms distinguish them")
        lines.append("check what was bumped or loosened there, and calibrate again")
    if verification.detectable_m is not None:
        probability = f"with a probability of {100 * POWER:.0f} %"
        lines.append(f"a shift of {two_digits(1e3 * verification.detectable_m)} mm would be detected {probability}")
    lines += [
        f"sample {number} disagrees with the others and was left out"
        for number in verification.outliers[:_SHOWN_SAMPLES]
    ]
    return "\n".join(lines)


def _shift_sentence(shift: Shift) -> str:
    if shift.joint is None:
        return f"{shift.frame},{format_tangent(shift.size, shift.covariance)}"
    offset_deg, sigma = np.degrees([shift.size[0], math.sqrt(shift.covariance[0, 0])])
    return f"the offset of {_frame_or_joint(shift)}, by {format_with_sigma(offset_deg, sigma)} deg"


def _frame_or_joint(shift: Shift) -> str:
    return shift.frame if shift.joint is None else f"joint {shift.joint + 1} of {shift.frame.removesuffix('_flange')}"


def history_dict(history: Sequence[PastVerification], drifts: Sequence[Drift]) -> dict[str, Any]:
    """One JSON object: all verifications, and the drift of each transform."""
    return {
        "verifications": [
            {
                "when": each.when.strftime("%Y-%m-%dT%H:%M:%SZ"),
                "run": each.run,
                "samples": each.samples,
                "moved": each.moved,
                "frame": each.frame,
                "p": each.chance,
                "detectable_mm": _mm(each.detectable_m),
                "shift_mm": {name: 1e3 * float(np.linalg.norm(shift.t_m)) for name, shift in each.shifts.items()},
            }
            for each in history
        ],
        "drift": [
            {
                "transform": each.transform,
                "run": each.run,
                "verifications": each.count,
                "mm_per_day": (1e3 * each.m_per_day).tolist(),
                "sigma_mm_per_day": (1e3 * each.sigma).tolist(),
                "p": each.chance,
            }
            for each in drifts
        ],
    }


def history_text(history: Sequence[PastVerification], drifts: Sequence[Drift]) -> str:
    """A line for each verification and for the drift of each transform."""
    if not history:
        return "nothing was verified yet: basecal verify CELL NEW.jsonl"
    lines = []
    for each in history:
        outcome = {False: "not moved", None: "cannot tell"}.get(each.moved, f"MOVED, {each.frame}")
        shifts = [f"{name} {error_text(float(np.linalg.norm(s.t_m)), None)}" for name, s in each.shifts.items()]
        lines.append(
            f"{each.when.strftime(_TIME_FORMAT)}  {outcome} ({p_value_text(each.chance)})  {', '.join(shifts)}"
        )
    return "\n".join([*lines, *map(drift_sentence, drifts)])


def drift_sentence(drift: Drift) -> str:
    """Sentence about whether a transform drifts, with its rate."""
    speed, sigma = 1e3 * float(np.linalg.norm(drift.m_per_day)), 1e3 * float(np.linalg.norm(drift.sigma))
    verb = "drifts" if drift.chance < MOVED_LEVEL else "does not drift:"
    rate = f"{format_with_sigma(speed, sigma)} mm a day"
    return f"{drift.transform} {verb} {rate} over {count_text(drift.count, 'check')} ({p_value_text(drift.chance)})"


def comparison_dict(names: Sequence[str], comparisons: Sequence[Comparison]) -> dict[str, Any]:
    """One JSON object: the differences of every other run from the first."""
    return {
        "runs": list(names),
        "agree": _all_agree(comparisons),
        "differences": [
            {
                "run": name,
                "agree": each.agree,
                "transforms": {
                    transform: {
                        "shift_mm": 1e3 * d.shift_m,
                        "shift_deg": math.degrees(d.shift_rad),
                        "sigmas": d.sigmas,
                        "p": d.chance,
                    }
                    for transform, d in each.transforms.items()
                },
                "only": {transform: names[0] if which == 0 else name for transform, which in each.only.items()},
                "inputs": list(each.inputs),
                "settings": {key: list(values) for key, values in each.settings.items()},
            }
            for name, each in zip(names[1:], comparisons, strict=True)
        ],
    }


def _all_agree(comparisons: Sequence[Comparison]) -> bool | None:
    answers = {each.agree for each in comparisons}
    return False if False in answers else None if None in answers else True


def comparison_text(names: Sequence[str], comparisons: Sequence[Comparison]) -> str:
    """Lines joined by newlines: whether runs agree, and their differences."""
    verdict = {True: "AGREE", False: "DISAGREE", None: "UNDECIDED: no transform is in both"}[_all_agree(comparisons)]
    lines = [verdict]
    for name, each in zip(names[1:], comparisons, strict=True):
        lines.append(f"{name} against {names[0]}")
        for transform, d in each.transforms.items():
            sigmas = (
                "" if d.sigmas is None or d.chance is None else f"  {d.sigmas:.1f} sigma ({p_value_text(d.chance)})"
            )
            lines.append(f"  {transform}  {error_text(d.shift_m, d.shift_rad)}{sigmas}")
        lines += [
            f"  {transform} is only in {names[0] if which == 0 else name}" for transform, which in each.only.items()
        ]
        lines += [f"  {file} differs" for file in each.inputs]
        for key, values in each.settings.items():
            first, this = ("not set" if value is None else value for value in values)
            lines.append(f"  {key}: {first} in {names[0]}, {this} in {name}")
    return "\n".join(lines)
