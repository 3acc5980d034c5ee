"""The registry of effects: to add an effect, write its module and list it here."""

from __future__ import annotations

import math
from collections.abc import Mapping

from basecal.effects import (
    bending,
    clock_drift,
    clock_offset,
    deflection,
    distortion,
    drift,
    fixed_transform,
    focal_length,
    gear_ratio,
    joint_offsets,
    length_scale,
    lens_sag,
    link_parameters,
    mount_bend,
    mount_play,
    principal_point,
    row_time,
    smooth,
    smooth_by_place,
    smooth_by_reach,
    smooth_in_time,
    step,
    stretch,
    target_shape,
    target_size,
)
from basecal.effects.faces.effect import Effect, FoundEffect, LensParameter, RandomEffect, Words
from basecal.effects.faces.robot_parameter import RobotParameter

EFFECTS: Mapping[str, Effect] = {
    module.EFFECT.name: module.EFFECT
    for module in (
        smooth,
        smooth_by_place,
        smooth_by_reach,
        smooth_in_time,
        joint_offsets,
        link_parameters,
        deflection,
        gear_ratio,
        fixed_transform,
        length_scale,
        target_size,
        target_shape,
        clock_offset,
        clock_drift,
        row_time,
        mount_bend,
        mount_play,
        lens_sag,
        step,
        drift,
        bending,
        stretch,
        focal_length,
        principal_point,
        distortion,
    )
}
"""All effects by name, in the order in which they are estimated and tested."""

ROBOT_PARAMETERS: Mapping[str, RobotParameter] = {
    name: effect.parameter for name, effect in EFFECTS.items() if effect.parameter is not None
}
"""Kinematic parameters of robots that can be estimated, by their key in cell.yaml."""

LENS_PARAMETERS: Mapping[str, LensParameter] = {
    name: effect.lens for name, effect in EFFECTS.items() if effect.lens is not None
}
"""Groups of lens parameters whose errors have their own scale, in the order of a lens's parameters."""

RANDOM_EFFECTS: Mapping[str, RandomEffect] = {
    name: effect.random for name, effect in EFFECTS.items() if effect.random is not None
}
"""Errors that a robot's stops share, by name."""

CONTAINED = tuple(
    name for name, effect in EFFECTS.items() if effect.expected is not None and not effect.expected.is_stated
)
"""Effects that every answer contains, with their expected size given the data."""

BY_PLACE = tuple(name for name, effect in EFFECTS.items() if effect.is_by_place)
"""Effects that smooth fields of position-dependent errors contain."""

CHANGES_IN_TIME = tuple(name for name, effect in EFFECTS.items() if effect.is_in_time)
"""Effects that change a frame in time."""


def largest_sigma(name: str) -> float:
    """Largest sigma in the prior of an effect's sizes; infinite if the effect has no such prior in every answer."""
    expected = EFFECTS[name].expected if name in CONTAINED else None
    return math.inf if expected is None else float(expected.prior(len(CONTAINED)).sigmas.max())


def describe_effect(effect: FoundEffect) -> Words:
    """Describe a found effect, with the alternatives that the data do not distinguish from it.

    Stated transforms come first, since an error of a statement is likelier than one of a device.
    """
    found = sorted((effect, *effect.alternatives), key=lambda each: each.effect != fixed_transform.EFFECT.name)
    texts = [_words(each) for each in found]
    first, *others = texts
    if not others:
        return first
    what = ", or ".join([first.what.rstrip("."), *(_as_clause(words.what.rstrip(".")) for words in others)])
    do = tuple(dict.fromkeys(sentence for words in texts for sentence in words.do))
    return Words(first.code, f"{what}.", do, "The data do not distinguish these.")


def _words(effect: FoundEffect) -> Words:
    words = EFFECTS[effect.effect].words
    assert words is not None
    return words(effect)


def _as_clause(sentence: str) -> str:
    """A sentence as a clause, with its first letter in lower case; names are lower case already."""
    return sentence[:1].lower() + sentence[1:]
