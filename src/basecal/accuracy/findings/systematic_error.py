"""Findings of effects that score tests found: lengths, clocks, moved frames, bent arms, joint offsets."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.findings.robot_model import robot_model
from basecal.accuracy.phrases.gravity import describe_gravity
from basecal.cell import Finding
from basecal.effects import deflection, joint_offsets
from basecal.effects.faces.effect import FoundEffect
from basecal.effects.registry import CONTAINED, describe_effect

_COVERED_SENTENCE = "The answer {} it, and its covariance is wider."
_NONLINEAR_SENTENCE = "The answer excludes it. Its covariance may be too small, since it is linear in errors of joints."
# Joints off by 17 mrad leave bases within their ellipsoids, joints off by 35 do not; assumed between.
_LINEAR_RAD = 0.03
_CHANCE_SENTENCE = (
    "It is real with a probability of {:.0f} % at most. The covariance and the expected errors contain it."
)


def systematic_error(evidence: Evidence) -> list[Finding]:
    """A warning of an error that explains the residuals far better than noise; an info if chance may do so, too.

    Joints that are off are left to `robot_model` if that finds its robots off, too: it reports all joints.
    """
    found = evidence.systematic_error
    named = () if found is None else (found, *found.alternatives)
    if found is None or (all(each.effect == joint_offsets.NAME for each in named) and robot_model(evidence)):
        return []
    words = describe_effect(found)
    why = [words.why, _answer_sentence(found) if found.is_certain else _CHANCE_SENTENCE.format(100 * found.share)]
    if found.effect == deflection.NAME:
        why.append(describe_gravity(evidence.cell, evidence.solution, (found.about,)))
    about = [each.about for each in named]
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
    """The sentence about the answer beside a certain effect."""
    if effect.effect == joint_offsets.NAME and np.abs(effect.size).max() > _LINEAR_RAD:
        return _NONLINEAR_SENTENCE
    return _COVERED_SENTENCE.format("contains" if effect.effect in CONTAINED else "excludes")
