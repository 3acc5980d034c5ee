"""Cells of many robots, one camera and one target at a time: what a mix-up is, each pair shows by its own views.

Among the samples of a hundred robots hardly any are of one pair, and each way to misread one robot would have to be
tried among all.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from basecal.cell import Cell, Finding, Recording, Unknown
from basecal.cell.cell import WORLD
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup

JOINT_PAIRS = 4
"""So many robots are looked at together: two arms and what stands beside them."""


@dataclass(frozen=True, eq=False)
class SinglePair:
    """A camera and a target as a cell of their own.

    Attributes:
        cell: The cell, with the robots that carry them and the reference.
        recording: The samples in which the camera sees the target.
        state: What is known of them; errors of stops are none.
    """

    cell: Cell
    recording: Recording
    state: State

    @property
    def robots(self) -> frozenset[str]:
        """Who carries the two."""
        on = [camera.on for camera in self.cell.cameras.values()] + [target.on for target in self.cell.targets.values()]
        return frozenset(on) - {WORLD}


def has_many_robots(problem: Problem) -> bool:
    """Whether a cell is looked at pair by pair."""
    return len(problem.robots) > JOINT_PAIRS


def solve_single_pairs(cell: Cell, recording: Recording, problem: Problem, state: State) -> list[SinglePair]:
    """Pairs of camera and target, as few as it takes for each robot, camera and target to be in one.

    Args:
        cell: As declared.
        recording: As recorded.
        problem: What was packed of both.
        state: What they gave.
    """
    seen: dict[tuple[str, str], list[int]] = {}
    for position, sample in enumerate(recording.samples):
        for each in sample.observations:
            seen.setdefault((each.camera, each.target), []).append(position)
    return [
        _solve_pair(cell, recording, group, seen[group.camera, group.target], state)
        for group in _covering(problem.groups)
    ]


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


def _solve_pair(cell: Cell, recording: Recording, group: ViewGroup, numbers: Sequence[int], state: State) -> SinglePair:
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
    samples = (
        replace(
            sample,
            robots={name: of for name, of in sample.robots.items() if name in group.robots},
            observations=tuple(o for o in sample.observations if (o.camera, o.target) == (group.camera, group.target)),
        )
        for sample in (recording.samples[k] for k in numbers)
    )
    own = replace(
        state,
        transforms={name: state.transforms[name] for name in alone.transforms if name in state.transforms},
        cameras={name: lens for name, lens in state.cameras.items() if name == group.camera},
        stop_errors=state.stop_errors[:0],
        robots={name: of for name, of in state.robots.items() if name in group.robots},
    )
    return SinglePair(alone, replace(recording, samples=tuple(samples)), own)
