"""Names of the passed checks, in a few words each."""

from __future__ import annotations

import re
from collections.abc import Iterator
from inspect import getmodule

from basecal.accuracy.findings.registry import ANSWER_CHECKS, INPUT_CHECKS
from basecal.cell import Calibration

_WORDS = re.compile(r"((?:`[a-z-]+`(?: and |, )?)+)[^:]*: (.*)")


def check_words() -> dict[str, str]:
    """The subject of each kind of finding, by its code: the first line of the module that finds it."""
    found: dict[str, str] = {}
    for check in (*INPUT_CHECKS, *ANSWER_CHECKS):
        words = _WORDS.match((getattr(getmodule(check), "__doc__", None) or "").partition("\n")[0])
        if words is not None:
            found |= dict.fromkeys(re.findall(r"`([a-z-]+)`", words[1]), words[2])
    return found


def passed_checks(calibration: Calibration) -> Iterator[tuple[str, str]]:
    """Codes and words of the checks that found nothing; none where nothing was calibrated."""
    found = {finding.code for finding in calibration.findings}
    if calibration.transforms:
        yield from (each for each in check_words().items() if each[0] not in found)
