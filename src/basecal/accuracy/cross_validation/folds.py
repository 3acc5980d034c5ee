"""Split of a recording into parts that can be held out: samples of one stop stay together.

Samples that share a stop share the error of the robot's pose. If some of these samples were used and others held out,
the held-out samples would be predicted too well. The parts are therefore stations, and finer parts only if stations are
too few or too large.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from basecal.estimation.problem.problem import Problem
from basecal.estimation.view.points import is_touch

Samples = frozenset[int]

FOLDS = 5  # recommended by Hastie et al. 2009 (7.10): each fit uses four fifths of the samples, at five times the cost
_FEWEST_PARTS = 3  # with two, each would be predicted from half of the recording; assumed
# Largest share of the samples in one part: a fit without it has three fifths, a fifth less than of five folds; assumed.
_LARGEST_SHARE = 0.4


@dataclass(frozen=True)
class Split:
    """A way to hold out every sample once.

    Attributes:
        parts: Sets of samples that stay together, such as the samples of one station.
        folds: Sets of samples that are held out together, each a union of parts.
    """

    parts: tuple[Samples, ...]
    folds: tuple[Samples, ...]


def splits(problem: Problem) -> Iterator[Split]:
    """Yield splits of the samples into at most five folds, the most severe split first.

    A split keeps samples together that share a stop of any moving robot, a stop of one robot, or the stops of all
    robots. A split is left out if its largest part has more than two fifths of the samples.
    """
    places, samples = _places(problem), problem.samples.tolist()
    found: list[Split] = []
    for parts in _partitions(samples, places):
        split = _split(parts, len(samples), FOLDS)
        if split is not None and all(split.folds != other.folds for other in found):
            found.append(split)
            yield split


def _partitions(samples: Sequence[int], places: Mapping[str, Mapping[int, Hashable]]) -> Iterator[list[Samples]]:
    """Yield the parts of each split lazily: with many robots, hardly more than the first is requested."""
    yield _join_parts(samples, places)
    for robot in sorted(places, key=lambda robot: (len(set(places[robot].values())), robot)):
        # A sample without the robot is a part of its own: its number in a tuple equals no stop.
        yield _split_by_label(samples, {n: places[robot].get(n, (n,)) for n in samples})
    yield _instants(samples, places)


def place_split(problem: Problem) -> Split | None:
    """Split of touched marks by their places, such as plates; None unless all views are touches of three places.

    Marks of one place are held out together. An arm's error depends on the place, so one place has no information about
    another.
    """
    marks, places = dict[int, Hashable](), dict[int, Hashable]()
    for group in problem.groups:
        still = next((end for end in group.ends if end.robot is None), None)
        if still is None or not is_touch(group.measurement):
            return None
        marks.update(dict.fromkeys(group.sample.tolist(), still.mount))
        places.update(dict.fromkeys(group.sample.tolist(), still.base or still.mount))
    samples = problem.samples.tolist()
    held = _split(_split_by_label(samples, places), len(samples), FOLDS)
    return None if held is None else Split(tuple(_split_by_label(samples, marks)), held.folds)


def instant_split(problem: Problem, count: int) -> Split | None:
    """Split that keeps only repeated instants together; None if these are too few."""
    samples = problem.samples.tolist()
    return _split(_instants(samples, _places(problem)), len(samples), count)


def _split(parts: list[Samples], total: int, count: int) -> Split | None:
    """Deal parts into at most `count` folds; None if the parts are too few, or one has too many of `total` samples."""
    if len(parts) < _FEWEST_PARTS or max(map(len, parts)) > max(_LARGEST_SHARE * total, 1):
        return None
    dealt: list[set[int]] = [set() for _ in range(min(count, len(parts)))]
    for part in parts:
        min(dealt, key=len).update(part)  # the fold with the fewest samples so far
    return Split(tuple(parts), tuple(map(frozenset, dealt)))


def _places(problem: Problem) -> dict[str, dict[int, Hashable]]:
    """Stop of each moving robot at each sample, by robot name and sample number."""
    places: dict[str, dict[int, Hashable]] = defaultdict(dict)
    for group in problem.groups:
        for end in group.ends:
            if end.robot is not None:
                places[end.robot].update(zip(map(int, group.sample), map(int, end.stop_number), strict=True))
    return {robot: stops for robot, stops in places.items() if len(set(stops.values())) > 1}


def _join_parts(samples: Sequence[int], places: Mapping[str, Mapping[int, Hashable]]) -> list[Samples]:
    """Join samples into the finest parts that share no stop of any robot."""
    part = {number: number for number in samples}

    def root(number: int) -> int:
        """Return the sample number that represents the part of a sample."""
        while part[number] != number:
            number = part[number]
        return number

    for stops in places.values():
        first: dict[Hashable, int] = {}
        for number, place in stops.items():
            part[root(number)] = root(first.setdefault(place, number))
    return _split_by_label(samples, {number: root(number) for number in samples})


def _instants(samples: Sequence[int], places: Mapping[str, Mapping[int, Hashable]]) -> list[Samples]:
    return _split_by_label(samples, {n: tuple(places[robot].get(n) for robot in sorted(places)) for n in samples})


def _split_by_label(samples: Sequence[int], label: Mapping[int, Hashable]) -> list[Samples]:
    parts: dict[Hashable, list[int]] = defaultdict(list)
    for number in samples:
        parts[label[number]].append(number)
    return [frozenset(part) for part in parts.values()]
