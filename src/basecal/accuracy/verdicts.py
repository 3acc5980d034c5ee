"""Verdicts of a calibration and of each transform, from the findings that concern them.

Cameras, targets and robots that share views or a transform are one group. A finding concerns the groups of the devices
and transforms that it is about. A finding about none of them concerns everything.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from basecal.cell import Finding
from basecal.cell.calibration import Verdict
from basecal.estimation.problem.problem import Problem
from basecal.estimation.problem.view_group import ViewGroup

_OWN_TRANSFORM_CODES = {"weak-direction", "unobservable-direction", "prior-dominated"}
"""Codes of findings about the uncertainty of one transform, which do not concern other transforms."""

_VERDICT_ORDER: tuple[Verdict, ...] = ("refused", "doubtful", "good")
_BY_SEVERITY: Mapping[str, Verdict] = {"error": "refused", "warning": "doubtful", "info": "good"}


def judge_findings(findings: Sequence[Finding]) -> Verdict:
    """`refused` with an error among the findings, `doubtful` with a warning, else `good`."""
    severities = {f.severity for f in findings}
    return "refused" if "error" in severities else "doubtful" if "warning" in severities else "good"


def transform_verdicts(problem: Problem, names: Iterable[str], findings: Sequence[Finding]) -> dict[str, Verdict]:
    """Verdict of each transform, by name.

    Args:
        problem: Problem whose views connect devices and transforms.
        names: Names of the transforms.
        findings: All findings of the calibration.
    """
    parts = _parts(problem)
    known = set().union(*parts)
    return {name: _verdict(name, parts, known, findings) for name in names}


def _verdict(name: str, parts: Sequence[set[str]], known_names: set[str], findings: Sequence[Finding]) -> Verdict:
    own = next((part for part in parts if name in part), known_names)
    found = {_BY_SEVERITY[each.severity] for each in findings if _is_about(each, name, own, known_names)}
    return next((verdict for verdict in _VERDICT_ORDER if verdict in found), "good")


def _is_about(finding: Finding, name: str, own: set[str], known_names: set[str]) -> bool:
    about = known_names.intersection(finding.about)
    if finding.code in _OWN_TRANSFORM_CODES and about:
        return name in about
    return not about or not about.isdisjoint(own)


def _parts(problem: Problem) -> list[set[str]]:
    """Sets of the names of devices and transforms that views connect."""
    parts: list[set[str]] = []
    for group in problem.all_groups:
        mine = _names(group)
        mine.update(*(part for part in parts if not part.isdisjoint(mine)))
        parts = [part for part in parts if part.isdisjoint(mine)] + [mine]
    return parts


def _names(group: ViewGroup) -> set[str]:
    return {group.camera, group.target, *group.robots, *group.frames}
