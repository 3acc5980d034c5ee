"""Cells of many robots, one camera and one target at a time: what a mix-up is, each pair shows by its own views.

Of the samples of a hundred robots hardly any belong to one pair. Each way to misread one robot would have to be tried
on all of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from basecal.accuracy.readings.reading import Reading
from basecal.cell import Finding, Unknown
from basecal.cell.cell import WORLD
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup

JOINT_PAIRS = 4
"""So many robots are looked at together: two arms and what stands beside them; assumed."""


@dataclass(frozen=True, eq=False)
class SinglePair:
    """A camera and a target as a cell of their own.

    Attributes:
        reading: The cell, with the robots that carry them and the reference, and the samples with a view of it.
        state: What is known of them; errors of stops are none.
    """

    reading: Reading
    state: State

    @property
    def robots(self) -> frozenset[str]:
        """The carriers of the two."""
        cell = self.reading.cell
        on = [camera.on for camera in cell.cameras.values()] + [target.on for target in cell.targets.values()]
        return frozenset(on) - {WORLD}


def has_many_robots(problem: Problem) -> bool:
    """Whether a cell is looked at pair by pair."""
    return len(problem.robots) > JOINT_PAIRS


def solve_single_pairs(baseline: Reading, state: State) -> list[SinglePair]:
    """Pairs of camera and target, as few as it takes for each robot, camera and target to be in one.

    Args:
        baseline: As declared.
        state: Its solution.
    """
    return [_solve_pair(baseline, group, state) for group in _covering(baseline.problem.groups)]


def merge_findings(pairs: Sequence[SinglePair], findings: Sequence[Sequence[Finding]]) -> tuple[Finding, ...]:
    """The findings of pairs, each once; of what one pair leaves open only that which all pairs of a robot do.

    Args:
        pairs: The pairs.
        findings: The findings of each.
    """
    opened = [{name for f in of if f.code == "ambiguous-convention" for name in f.about} for of in findings]
    kept: dict[tuple[str, tuple[str, ...]], Finding] = {}
    for pair, of in zip(pairs, findings, strict=True):
        for finding in of:
            about = pair.robots.intersection(finding.about)
            others = [names for other, names in zip(pairs, opened, strict=True) if about & other.robots]
            if finding.code != "ambiguous-convention" or all(about & names for names in others):
                kept.setdefault((finding.code, finding.about), finding)
    return tuple(kept.values())


def _covering(groups: Sequence[ViewGroup]) -> Iterator[ViewGroup]:
    """Groups until each robot, camera and target is in one; that with most that no other has comes next."""
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
        # How the two stand to each other is all that the pair tells.
        bases[group.eye.robot] = Unknown("fixed", state.transforms[group.eye.base])
    alone = replace(
        cell,
        robots={name: robot for name, robot in cell.robots.items() if name in {*group.robots, cell.reference}},
        bases=bases,
        cameras={group.camera: cell.cameras[group.camera]},
        targets={group.target: cell.targets[group.target]},
    )
    own = replace(
        state,
        transforms={name: state.transforms[name] for name in alone.transforms if name in state.transforms},
        cameras={name: lens for name, lens in state.cameras.items() if name == group.camera},
        stop_errors=state.stop_errors[:0],
        robots={name: of for name, of in state.robots.items() if name in group.robots},
    )
    return SinglePair(baseline.single_group(alone, group), own)
