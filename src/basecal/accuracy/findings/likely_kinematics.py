"""`robot-model` or `deflection` as an info: a random effect of robots that the covariance contains already."""

from __future__ import annotations

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.findings.robot_model import robot_model
from basecal.accuracy.model_comparison.nested_models import compare_evidence
from basecal.accuracy.phrases.gravity import describe_gravity
from basecal.cell import Finding
from basecal.effects import deflection
from basecal.effects.registry import RANDOM_EFFECTS, describe_effect

_ARM_CODES = {"robot-model", "deflection"}
_CONTAINED_SENTENCE = "The covariance contains it."


def likely_kinematics(evidence: Evidence) -> list[Finding]:
    """An info about an effect of joints or links whose evidence is far above that of independent stop errors.

    Empty if a warning reports the effect already.
    """
    noise = evidence.solution.noise
    name, sigmas = next((each for each in noise.common.items() if RANDOM_EFFECTS[each[0]].likely), ("", {}))
    likely = RANDOM_EFFECTS[name].likely if name else None
    if likely is None or not compare_evidence(noise.plain_minus_2_log_evidence - noise.minus_2_log_evidence).is_taken:
        return []
    words = likely(sigmas)
    found = evidence.systematic_error
    if found is not None and describe_effect(found).code in _ARM_CODES:
        return []
    if words.code == "robot-model" and robot_model(evidence):
        return []
    why = [_CONTAINED_SENTENCE]
    if name == deflection.NAME:
        why.append(describe_gravity(evidence.cell, evidence.solution, tuple(sigmas)))
    return [Finding(words.code, "info", tuple(sigmas), words.what, words.do, " ".join(why))]
