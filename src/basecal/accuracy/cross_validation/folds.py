"""Parts of a recording that can be held out: where an arm stands still, its samples stay together.

Samples that share a stop share the error of the robot's pose. If some of them were used and some held out, the held-out
ones would be predicted too well. Stations therefore come first, and finer parts only if stations are too few or too
large.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from basecal.estimation.problem.problem import Problem
from basecal.estimation.view.points import is_touch

Samples = frozenset[int]

FOLDS = 5  # as Hastie et al. 2009 (7.10) advise: each fit has four fifths of the samples, at five times the work
_FEWEST_PARTS = 3  # with two, each would be predicted from half of the recording; assumed
# Of the samples in one part: without it three fifths are left, a fifth less than of five folds; assumed.
_LARGEST_SHARE = 0.4


@dataclass(frozen=True)
class Split:
    """A way to hold out every sample once.

    Attributes:
        parts: Samples that stay together, such as those at one station.
        folds: The parts dealt out.
    """

    parts: tuple[Samples, ...]
    folds: tuple[Samples, ...]


def splits(problem: Problem) -> Iterator[Split]:
    """Ways to split the samples into at most five folds to be held out one after another, the most severe first.

    Each keeps together what stands in one place: of every robot that moves, of one robot, or of nothing but repeated
    instants. A way whose largest part is more than two fifths of the samples is left out.
    """
    places, samples = _places(problem), _samples(problem)
    found: list[Split] = []
    for parts in _ways(samples, places):
        split = _split(parts, len(samples), FOLDS)
        if split is not None and all(split.folds != other.folds for other in found):
            found.append(split)
            yield split


def _ways(samples: Sequence[int], places: Mapping[str, Mapping[int, Hashable]]) -> Iterator[list[Samples]]:
    """Parts by each way, made as they are requested: of many robots hardly any but the first is."""
    yield _join_parts(samples, places)
    for robot in sorted(places, key=lambda robot: (len(set(places[robot].values())), robot)):
        yield _split_by_label(samples, {n: places[robot].get(n, n) for n in samples})
    yield _instants(samples, places)


def place_split(problem: Problem) -> Split | None:
    """Marks, held out by the places where they stay together, such as plates; None unless all views are touches.

    An arm's error depends on its place, so that one place has no information about another.
    """
    marks, places = dict[int, Hashable](), dict[int, Hashable]()
    for group in problem.groups:
        still = next((end for end in group.ends if end.robot is None), None)
        if still is None or not is_touch(group.measurement):
            return None
        marks.update(dict.fromkeys(group.sample.tolist(), still.mount))
        places.update(dict.fromkeys(group.sample.tolist(), still.base or still.mount))
    samples = _samples(problem)
    held = _split(_split_by_label(samples, places), len(samples), FOLDS)
    return None if held is None else Split(tuple(_split_by_label(samples, marks)), held.folds)


def instant_split(problem: Problem, count: int) -> Split | None:
    """The mildest way, which keeps together nothing but repeated instants; None if these are too few."""
    samples = _samples(problem)
    return _split(_instants(samples, _places(problem)), len(samples), count)


def _split(parts: list[Samples], total: int, count: int) -> Split | None:
    if len(parts) < _FEWEST_PARTS or max(map(len, parts)) > max(_LARGEST_SHARE * total, 1):
        return None
    dealt: list[set[int]] = [set() for _ in range(min(count, len(parts)))]
    for part in parts:
        min(dealt, key=len).update(part)  # the fold with the fewest samples so far
    return Split(tuple(parts), tuple(map(frozenset, dealt)))


def _samples(problem: Problem) -> list[int]:
    return sorted({int(number) for group in problem.groups for number in group.sample})


def _places(problem: Problem) -> dict[str, dict[int, Hashable]]:
    """The stop of each moving robot at each sample, by robot."""
    places: dict[str, dict[int, Hashable]] = defaultdict(dict)
    for group in problem.groups:
        for end in group.ends:
            if end.robot is not None:
                places[end.robot].update(zip(map(int, group.sample), map(int, end.stand), strict=True))
    return {robot: at for robot, at in places.items() if len(set(at.values())) > 1}


def _join_parts(samples: Sequence[int], places: Mapping[str, Mapping[int, Hashable]]) -> list[Samples]:
    """Parts that share no place of any robot."""
    part = {number: number for number in samples}

    def root(number: int) -> int:
        """The number that represents a sample's part."""
        while part[number] != number:
            number = part[number]
        return number

    for at in places.values():
        first: dict[Hashable, int] = {}
        for number, place in at.items():
            part[root(number)] = root(first.setdefault(place, number))
    return _split_by_label(samples, {number: root(number) for number in samples})


def _instants(samples: Sequence[int], places: Mapping[str, Mapping[int, Hashable]]) -> list[Samples]:
    return _split_by_label(samples, {n: tuple(places[robot].get(n) for robot in sorted(places)) for n in samples})


def _split_by_label(samples: Sequence[int], label: Mapping[int, Hashable]) -> list[Samples]:
    parts: dict[Hashable, list[int]] = defaultdict(list)
    for number in samples:
        parts[label[number]].append(number)
    return [frozenset(part) for part in parts.values()]
