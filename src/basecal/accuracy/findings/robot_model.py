"""`robot-model`: errors of a robot's joint offsets or links, found by cross-validation."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.cross_validation.robot_model_selection import (
    LINKS,
    OFFSETS,
    Candidate,
    RobotModelChoice,
)
from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.robot_parameters import robot_parameters
from basecal.cell import Finding
from basecal.effects import joint_offsets, link_parameters
from basecal.effects.faces.effect import FoundEffect
from basecal.effects.registry import ROBOT_PARAMETERS
from basecal.fields.digits import two_digits


def robot_model(evidence: Evidence) -> list[Finding]:
    """A finding as `robot_model_findings`; empty if joint offsets only compensate another effect of the joints."""
    if evidence.robot_model is None or _is_other_effect(evidence.systematic_error, evidence.robot_model.chosen):
        return []
    return robot_model_findings(evidence.robot_model)


def _is_other_effect(effect: FoundEffect | None, candidate: Candidate) -> bool:
    """Whether a joint effect that no candidate contains is certain, for a robot whose offsets are chosen."""
    if effect is None or not effect.is_certain or candidate.kind not in ("joint", "offsets"):
        return False
    effects = {each.effect for each in (effect, *effect.alternatives)} & ROBOT_PARAMETERS.keys()
    return effect.about in candidate.robots and bool(effects) and effects.isdisjoint({OFFSETS, LINKS})


def robot_model_findings(choice: RobotModelChoice) -> list[Finding]:
    """A finding with the parameters to free, their gain and the line to write; empty if the robots are as stated."""
    none, chosen = choice.candidates[0], choice.chosen
    if chosen.kind == "none" and choice.better is None:
        return []
    if chosen.kind == "none" and choice.better is not None:
        what = f"Freeing {_parameter_phrase(choice.better)} may lower {_error_change(none, choice.better)}."
        why, do = "There are too few samples to decide.", ("Record more samples.",)
        return [Finding("robot-model", "info", choice.better.robots, what, do, why)]
    what, why = f"Freeing {_parameter_phrase(chosen)} lowers {_error_change(none, chosen)}.", _largest_deviation(choice)
    if choice.better is not None:
        why += f" Whether freeing {_parameter_phrase(choice.better)} helps more is undecided."
    offsets = robot_parameters(choice.solution).get(OFFSETS, {})
    values = np.concatenate([np.zeros(0), *(each.values[each.seen] for each in offsets.values())])
    entry = joint_offsets.entry(values)
    if chosen.kind == "links":
        entry += f" and {link_parameters.entry(values)}"
    do = (f"Write {entry} at {' and '.join(chosen.robots)} in cell.yaml.",)
    return [Finding("robot-model", "warning", chosen.robots, what, do, why)]


def _parameter_phrase(candidate: Candidate) -> str:
    robots = " and ".join(candidate.robots)
    if candidate.joint is not None:
        return f"the offset of joint {candidate.joint + 1} of {robots}"
    return f"the {'joint offsets' if candidate.kind == 'offsets' else 'joint offsets and links'} of {robots}"


def _error_change(baseline: Candidate, candidate: Candidate) -> str:
    if baseline.error_m is not None and candidate.error_m is not None:
        before, after = two_digits(1e3 * baseline.error_m), two_digits(1e3 * candidate.error_m)
        return f"the cross-validation error from {before} to {after} mm rms"
    return f"the cross-validation error from {two_digits(baseline.rms)} to {two_digits(candidate.rms)} sigmas rms"


def _largest_deviation(choice: RobotModelChoice) -> str:
    """Describe the most significant joint offset, or the largest link error."""
    if choice.chosen.kind == "links":
        tangents = np.concatenate([each.kind_values(LINKS) for each in choice.solution.state.robots.values()])
        off_m, off_rad = (float(np.linalg.norm(half, axis=1).max()) for half in np.split(tangents, 2, axis=1))
        return f"Links are off by up to {two_digits(1e3 * off_m)} mm and {two_digits(np.degrees(off_rad))} deg."
    found = robot_parameters(choice.solution).get(OFFSETS, {})
    seen = [(abs(o.values[j]) / o.sigma[j], r, int(j)) for r, o in found.items() for j in np.flatnonzero(o.seen)]
    if not seen:
        return "No single offset stands out."
    _, robot, joint = max(seen)
    offsets = found[robot]
    value, sigma = np.degrees(offsets.values[joint]), np.degrees(offsets.sigma[joint])
    whose = "Its offset" if choice.chosen.kind == "joint" else f"The clearest offset, of joint {joint + 1} of {robot},"
    return f"{whose} is {value:.2f} ± {two_digits(sigma)} deg."
