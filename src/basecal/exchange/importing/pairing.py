"""Which sample each imported row belongs to: by order, unless a name, a number or a time says otherwise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

import numpy as np

from basecal.cell import Sample
from basecal.errors import InputError, list_names
from basecal.exchange.importing.imported import By, Imported, Row

LARGEST_DIFFERENCE_S = 0.05
"""Between a row and its sample where times pair them: half of what a camera of 10 pictures a second leaves open."""


@dataclass(frozen=True)
class Pairing:
    """The sample of each row.

    Attributes:
        by: What they were paired by.
        numbers: Of the sample, for each row; None if it was not paired.
        unpaired_rows: In words: file names, numbers or times.
        unpaired_samples: Numbers of the samples that no row belongs to.
    """

    by: By
    numbers: tuple[int | None, ...]
    unpaired_rows: tuple[str, ...] = ()
    unpaired_samples: tuple[int, ...] = ()


def pair(imported: Imported, samples: Sequence[Sample], names: Mapping[str, int]) -> Pairing:
    """The samples of the rows; a number that no sample has is that of a new one.

    Args:
        imported: What was read.
        samples: Those that are recorded.
        names: Samples of the pictures that a table named before.

    Raises:
        InputError: if it is by order and there are more or fewer rows than samples, or two rows belong to one sample;
            if it is to be by name and nothing that is recorded has one; of a stream, if what it reports is recorded
            already.
    """
    rows, by = imported.rows, imported.by
    if imported.is_stream:
        return _lines_of_their_own(imported, samples)
    known = dict(names)
    if by == "image" or not any(row.pictures for row in rows):
        # Pictures of one camera are named by chance as those of another.
        known = {**{name: s.sample for s in samples for name in map(plain_name, s.images.values())}, **names}
    chosen = _pairing_method(rows, samples, known) if by is None else by
    if not samples and chosen != "sample":
        numbers: list[int | None] = list(range(len(rows)))
    elif chosen == "image":
        numbers = _pair_by_name(imported, samples, known)
    elif chosen == "sample":
        numbers = [row.sample for row in rows]
    elif chosen == "stamp_s":
        numbers = _pair_by_time(rows, samples)
    else:
        numbers = _pair_by_order(imported, samples)
    _check_unique(imported, numbers)
    paired = set(numbers)
    return Pairing(
        chosen,
        tuple(numbers),
        tuple(_name(row, i) for i, row in enumerate(rows) if numbers[i] is None),
        tuple(sample.sample for sample in samples if sample.sample not in paired),
    )


def _lines_of_their_own(imported: Imported, samples: Sequence[Sample]) -> Pairing:
    """Numbers beyond all that are recorded.

    Raises:
        InputError: if a robot, or a camera's view of a target, is recorded already.
    """
    again = sorted(_content_names(imported.rows) & _content_names(samples))
    if again:
        raise InputError(
            f"{imported.source}: {list_names(again)} is recorded already, and would stand beside itself; "
            "import into another folder, and `basecal merge` both"
        )
    first = max((sample.sample for sample in samples), default=-1) + 1
    return Pairing("sample", tuple(range(first, first + len(imported.rows))))


def _content_names(lines: Sequence[Row | Sample]) -> set[str]:
    """What lines report, in words."""
    robots = {f"robot {name!r}" for line in lines for name in line.robots}
    return robots | {f"target {o.target!r} seen by {o.camera!r}" for line in lines for o in line.observations}


def _pairing_method(rows: Sequence[Row], samples: Sequence[Sample], known: Mapping[str, int]) -> By:
    names = {plain_name(row.image) for row in rows if row.image is not None}
    # A table that names other pictures tells of other samples; a folder may hold another camera's in the same order.
    of_others = known and not any(row.pictures for row in rows)
    if rows and all(row.image is not None for row in rows) and (of_others or names & known.keys()):
        return "image"
    if rows and all(row.sample is not None for row in rows):
        return "sample"
    timed = all(row.stamp_s is not None for row in rows) and all(s.stamp_s is not None for s in samples)
    return "stamp_s" if rows and samples and timed else "order"


def _pair_by_name(imported: Imported, samples: Sequence[Sample], known: Mapping[str, int]) -> list[int | None]:
    """The samples of rows that name pictures; new ones where none is known, as of another camera's pictures."""
    numbers = [known.get(plain_name(row.image or "")) for row in imported.rows]
    if any(number is not None for number in numbers):
        return numbers
    if not known:
        raise InputError(
            f"{imported.source}: what is recorded names no pictures to pair by: leave `--by name` away to pair in "
            "order, or import tables with a column `image` into another folder"
        )
    first = max(sample.sample for sample in samples) + 1
    return list(range(first, first + len(imported.rows)))


def _pair_by_order(imported: Imported, samples: Sequence[Sample]) -> list[int | None]:
    if len(imported.rows) != len(samples):
        counts = f"{imported.source} holds {len(imported.rows)}, the recording has {len(samples)} samples"
        raise InputError(
            f"{counts}: row i belongs to sample i; where it does not, a column `image` or `sample` of a table says so, "
            "and --by name of pictures"
        )
    return [sample.sample for sample in samples]


def _pair_by_time(rows: Sequence[Row], samples: Sequence[Sample]) -> list[int | None]:
    """The sample nearest in time, where the row is the nearest to it as well, and near enough."""
    times = np.array([sample.stamp_s for sample in samples], dtype=np.float64)
    found: list[int | None] = [None] * len(rows)
    of_rows = np.array([row.stamp_s for row in rows], dtype=np.float64)
    for i, stamp in enumerate(of_rows):
        k = int(np.argmin(np.abs(times - stamp)))
        if abs(times[k] - stamp) <= LARGEST_DIFFERENCE_S and i == int(np.argmin(np.abs(of_rows - times[k]))):
            found[i] = samples[k].sample
    if not any(number is not None for number in found):
        spans = f"{of_rows.min():g} to {of_rows.max():g} s, the samples' from {times.min():g} to {times.max():g} s"
        raise InputError(
            f"no time of a row is within {LARGEST_DIFFERENCE_S} s of a sample's: the rows' are from {spans}"
        )
    return found


def _check_unique(imported: Imported, numbers: Sequence[int | None]) -> None:
    first: dict[int, int] = {}
    for i, number in enumerate(numbers):
        if number is not None and first.setdefault(number, i) != i:
            both = list_names([_name(imported.rows[first[number]], first[number]), _name(imported.rows[i], i)])
            raise InputError(f"{imported.source}: two rows belong to sample {number} ({both}); keep one")


def _name(row: Row, index: int) -> str:
    if row.image is not None:
        return row.image
    return f"row {index + 1}" if row.stamp_s is None else f"row {index + 1} ({row.stamp_s:.3f} s)"


def plain_name(name: str) -> str:
    """A picture's name without its folders and its ending, in which programs differ."""
    return PurePosixPath(name.replace("\\", "/")).stem
