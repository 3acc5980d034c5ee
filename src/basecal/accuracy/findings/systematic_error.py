"""Findings about effects detected by score tests: lengths, clocks, moved frames, bent arms, joint offsets."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.findings.robot_model import robot_model
from basecal.accuracy.phrases.gravity import describe_gravity
from basecal.accuracy.phrases.target_length import corrected_length_clause
from basecal.cell import Cell, Finding
from basecal.effects import deflection, joint_offsets
from basecal.effects.faces.effect import FoundEffect, format_with_sigma
from basecal.effects.registry import CONTAINED, describe_effect

_COVERED_SENTENCE = "The answer {} it, and its covariance is wider."
_NONLINEAR_SENTENCE = "The answer excludes it. Its covariance may be too small, since it is linear in errors of joints."
# [rad] With joint offsets of 17 mrad bases are within their ellipsoids, with 35 mrad they are not; assumed between.
_LINEAR_RAD = 0.03
_CHANCE_SENTENCE = (
    "It is real with a probability of {:.0f} % at most. The covariance and the expected errors contain it."
)


def systematic_error(evidence: Evidence) -> list[Finding]:
    """A warning about an error that explains the residuals far better than noise; an info if it may be chance.

    Joint offsets are left to `robot_model` if it has a finding, since it reports all joints.
    """
    found = evidence.systematic_error
    effects = () if found is None else (found, *found.alternatives)
    if found is None or (all(each.effect == joint_offsets.NAME for each in effects) and robot_model(evidence)):
        return []
    words = describe_effect(found)
    why = [words.why, _answer_sentence(found) if found.is_certain else _CHANCE_SENTENCE.format(100 * found.probability)]
    if found.effect == deflection.NAME:
        why.append(describe_gravity(evidence.cell, evidence.solution, (found.about,)))
    about = [each.about for each in effects]
    return [
        Finding(
            words.code,
            "warning" if found.is_certain else "info",
            tuple(dict.fromkeys(about)),
            words.what if found.is_certain else f"Perhaps chance: {words.what}",
            words.do,
            " ".join(filter(None, why)),
        )
    ]


def _answer_sentence(effect: FoundEffect) -> str:
    """Sentence on how the answer accounts for a certain effect."""
    if effect.effect == joint_offsets.NAME and np.abs(effect.size).max() > _LINEAR_RAD:
        return _NONLINEAR_SENTENCE
    return _COVERED_SENTENCE.format("contains" if effect.effect in CONTAINED else "excludes")


_CODES = "board-size", "length-scale"


def deduplicate_size_findings(cell: Cell, findings: Sequence[Finding], error: FoundEffect | None) -> list[Finding]:
    """Merge findings about the same length error of a target into one.

    The test of conventions assumes that robots are exact, so its size absorbs some of their noise. The test of
    systematic errors estimates the noise jointly with the size.

    Args:
        cell: The declared cell.
        findings: All findings.
        error: The systematic error; None if there is none.
    """
    suspected = any(f.code == "board-size" and f.severity == "warning" for f in findings)
    if not suspected or error is None or error.code != "length-scale" or not error.is_certain:
        return list(findings)
    either = [each for each in (error, *error.alternatives) if each.code == "length-scale"]
    size = next((each for each in either if each.is_target), None)
    if size is None:
        return [f for f in findings if f.code != "board-size"]
    target, factor = size.about, 1 / (1 - size.size[0])
    sigma = size.sigma * factor**2
    what = f"{target} is {format_with_sigma(factor, sigma)} times as large as stated"
    robots = [each.about for each in either if not each.is_target]
    if robots:
        what += f" if the lengths of the poses of {' and '.join(robots)} are right, which the data do not determine"
    do = (f"Measure {target} and state its true size{corrected_length_clause(cell, target, factor)}.",)
    why = "The answer excludes it, and its covariance is wider."
    finding = Finding("board-size", "warning", (target,), f"{what}.", do, why)
    return [finding, *(f for f in findings if f.code not in _CODES)]
