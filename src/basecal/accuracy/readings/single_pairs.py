"""Split of a cell of many robots into pairs of one camera and one target, whose own views show input mistakes.

With a hundred robots, hardly any samples belong to a given pair. Without the split, each hypothesis about one robot
would be fitted to the views of all robots.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from basecal.accuracy.readings.reading import Reading
from basecal.cell import Finding, Unknown
from basecal.cell.cell import WORLD
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup

_MOST_JOINT_ROBOTS = 4
"""Largest number of robots that are checked jointly: two arms and their additional axes; assumed."""


@dataclass(frozen=True, eq=False)
class SinglePair:
    """A camera and a target as a separate cell.

    Attributes:
        reading: The cell with the two carriers and the reference robot, and the samples with a view of the pair.
        state: Estimated state of the pair, without stop errors.
    """

    reading: Reading
    state: State

    @property
    def robots(self) -> frozenset[str]:
        """Robots that carry the camera and the target."""
        cell = self.reading.cell
        on = [camera.on for camera in cell.cameras.values()] + [target.on for target in cell.targets.values()]
        return frozenset(on) - {WORLD}


def has_many_robots(problem: Problem) -> bool:
    """Whether a cell has too many robots to be checked jointly."""
    return len(problem.robots) > _MOST_JOINT_ROBOTS


def solve_single_pairs(baseline: Reading, state: State, groups: Sequence[ViewGroup] | None = None) -> list[SinglePair]:
    """Pairs of camera and target; by default those that cover each robot, camera and target.

    Args:
        baseline: The declared reading.
        state: Solved state of the declared reading.
        groups: Views of the pairs; as few as a greedy choice needs if not given.
    """
    chosen = _covering(baseline.problem.groups) if groups is None else groups
    return [_solve_pair(baseline, group, state) for group in chosen]


def merge_findings(pairs: Sequence[SinglePair], findings: Sequence[Sequence[Finding]]) -> tuple[Finding, ...]:
    """Merge the findings of pairs; keep an `ambiguous-convention` only if all pairs of its robots have one.

    Args:
        pairs: The pairs.
        findings: Findings of each pair.
    """
    ambiguous_names = [{name for f in own if f.code == "ambiguous-convention" for name in f.about} for own in findings]
    kept: dict[tuple[str, tuple[str, ...]], Finding] = {}
    for pair, own in zip(pairs, findings, strict=True):
        for finding in own:
            about = pair.robots.intersection(finding.about)
            others = [names for other, names in zip(pairs, ambiguous_names, strict=True) if about & other.robots]
            if finding.code != "ambiguous-convention" or all(about & names for names in others):
                kept.setdefault((finding.code, finding.about), finding)
    return tuple(kept.values())


def _covering(groups: Sequence[ViewGroup]) -> Iterator[ViewGroup]:
    """Greedy cover: groups of views until each robot, camera and target is in one."""
    names = [{g.camera, g.target, *g.robots} for g in groups]
    left = set().union(*names)
    while left:
        most = max(range(len(groups)), key=lambda k: (len(names[k] & left), len(groups[k])))
        left -= names[most]
        yield groups[most]


def _solve_pair(baseline: Reading, group: ViewGroup, state: State) -> SinglePair:
    cell = baseline.cell
    bases = {name: unknown for name, unknown in cell.bases.items() if name in group.robots}
    if group.eye.robot is not None and group.eye.base is not None and group.hand.base is not None:
        # The pair determines only the pose of the two bases relative to each other.
        bases[group.eye.robot] = Unknown("fixed", state.transforms[group.eye.base])
    pair_cell = replace(
        cell,
        robots={name: robot for name, robot in cell.robots.items() if name in {*group.robots, cell.reference}},
        bases=bases,
        cameras={group.camera: cell.cameras[group.camera]},
        targets={group.target: cell.targets[group.target]},
    )
    pair_state = replace(
        state,
        transforms={name: state.transforms[name] for name in pair_cell.transforms if name in state.transforms},
        cameras={name: lens for name, lens in state.cameras.items() if name == group.camera},
        stop_errors=state.stop_errors[:0],
        robots={name: errors for name, errors in state.robots.items() if name in group.robots},
    )
    return SinglePair(baseline.single_group(pair_cell, group), pair_state)
