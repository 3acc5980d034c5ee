"""Findings for calibrations from arrays: with OpenCV's names, and without advice about files."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

from basecal.cell import Finding

_OF_FILES = re.compile(r", or (?:state \S+ as a prior or fixed|state `noise` in cell\.yaml|what cell\.yaml[^.]*)")
_COMMANDS = ("`basecal ", "cell.yaml", "--")


def _inverse_name(argument: str) -> str:
    """Return the name `b2a` for `a2b`."""
    source, _, into = argument.partition("2")
    return f"{into}2{source}"


def _arm_words(robot: str, noun: str, base: str, gripper: str, argument: str) -> dict[str, str]:
    """Replacements for the phrases about a robot, whose poses are the arrays `R_argument` and `t_argument`."""
    arrays = f"R_{argument}, t_{argument}"
    return {
        robot: noun,
        f"{robot}_base": base,
        f"{robot}_flange": gripper,
        f"poses of {robot}": f"poses {arrays}",
        f"rotation matrices of {robot}": f"matrices R_{argument}",
        f"Write base_from_flange of {robot}": f"Give {argument} as {arrays}",
    }


def _view_words(argument: str) -> dict[str, str]:
    """Replacements for the phrases about observations, which are the arrays `R_argument` and `t_argument`."""
    arrays = f"R_{argument}, t_{argument}"
    return {
        "observed poses": f"poses {arrays}",
        "poses of the target": f"poses {arrays}",
        "rotation matrices of the observed target": f"matrices R_{argument}",
        "Write camera_from_target": f"Give {argument} as {arrays}",
        "target_from_camera": _inverse_name(argument),
    }


HAND_EYE_WORDS = {
    **_arm_words("eye", "the gripper", "base", "gripper", "gripper2base"),
    **_arm_words("hand", "the gripper", "base", "gripper", "gripper2base"),
    **_view_words("target2cam"),
    "flange_from_base": "base2gripper",
    "import with the other --camera-on": "give the other camera_on",
    "import the inverse poses, with camera on world": "give the inverse poses, with camera_on='world'",
    "import the inverse poses, with target on world": "give the inverse poses, with camera_on='robot'",
}
"""Words of `basecal.hand_eye`, by words of the cell."""

ROBOT_WORLD_WORDS = {
    **_arm_words("eye", "the gripper", "base", "gripper", "base2gripper"),
    **_view_words("world2cam"),
    "flange_from_base": "gripper2base",
    "import with the other --camera-on": "call hand_eye with camera_on='world'",
    "import the inverse poses, with camera on world": "call hand_eye with the inverse poses and camera_on='world'",
}
"""Words of `basecal.robot_world`, by words of the cell."""

BASE_TO_BASE_WORDS = {
    **_arm_words("eye", "eye", "eye_base", "eye_gripper", "eye_gripper2base"),
    **_arm_words("hand", "hand", "hand_base", "hand_gripper", "hand_gripper2base"),
    **_view_words("target2cam"),
    "flange_from_base": "base2gripper",
    "poses of eye and hand": "poses of eye and hand",
}
"""Words of `basecal.base_to_base`, by words of the cell."""


def rename_finding(finding: Finding, words: Mapping[str, str]) -> Finding:
    """Rename the frames of a finding to those of arrays, and remove advice to edit or import files.

    Args:
        finding: Finding with the names of the cell.
        words: Words of the arrays, by names and phrases of the cell.
    """
    pattern = re.compile(rf"(?<!\w)(?:{'|'.join(map(re.escape, sorted(words, key=len, reverse=True)))})(?!\w)")

    def rename(text: str) -> str:
        """Replace the words of a text; a sentence that now begins with "the" gets a capital."""
        found = pattern.sub(lambda match: words[match[0]], _OF_FILES.sub("", text))
        return re.sub(r"(^|\. )the ", r"\1The ", found)

    advice = (rename(each) for each in finding.do)
    return replace(
        finding,
        about=tuple(words.get(name, name).removeprefix("the ") for name in finding.about),
        what=rename(finding.what),
        why=rename(finding.why),
        do=tuple(each for each in advice if not any(word in each for word in _COMMANDS)),
    )
