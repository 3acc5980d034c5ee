"""Pairing of imported rows with samples: by image name, sample number or time, otherwise by order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

import numpy as np

from basecal.cell import RobotState, Sample
from basecal.errors import InputError, count_text, list_names
from basecal.exchange.images import missing_numbers
from basecal.exchange.importing.imported import Imported, PairingMethod, Row

_ROBOT = "robot"
_STATE_TOLERANCE = 1e-9  # [m, rad]: rounding of poses in files
LARGEST_DIFFERENCE_S = 0.05
"""Largest time between a row and its sample: half the period of a camera with 10 images per second."""


@dataclass(frozen=True)
class Pairing:
    """Assignment of rows to samples.

    Attributes:
        by: Method of pairing.
        numbers: Sample number of each row; None if the row was not paired.
        unpaired_rows: Names of the unpaired rows: file names, numbers or times.
        unpaired_samples: Numbers of the samples without a row.
    """

    by: PairingMethod
    numbers: tuple[int | None, ...]
    unpaired_rows: tuple[str, ...] = ()
    unpaired_samples: tuple[int, ...] = ()


def pair(imports: Imported, samples: Sequence[Sample], names: Mapping[str, int], replace: bool = False) -> Pairing:
    """Pair rows with samples; a row with a new number becomes a new sample.

    Samples that already have the content of the rows belong to an earlier session and are not paired.

    Args:
        imports: The imported rows.
        samples: The recorded samples.
        names: Sample numbers by image name, from earlier tables.
        replace: Whether rows replace recorded content.

    Raises:
        InputError: if rows and samples paired by order differ in number, or two rows belong to one sample. It is also
            raised if nothing recorded has a name to pair by, or if the content is already recorded.
    """
    rows, by = imports.rows, imports.by
    waiting = samples if replace else _samples_of_carrier(imports, samples_without_content(rows, samples))
    is_numbered = all(row.sample is not None for row in rows)
    if imports.is_stream or imports.is_session or (samples and not waiting and not is_numbered):
        return _own_samples(imports, samples)
    known = dict(names)
    if by == "image" or not any(row.images for row in rows):
        # Images of two cameras may have the same names by coincidence.
        known = {**{name: s.sample for s in samples for name in map(plain_name, s.images.values())}, **names}
    chosen = _pairing_method(rows, waiting, known) if by is None else by
    if not samples and chosen != "sample":
        numbers: list[int | None] = list(range(len(rows)))
    elif chosen == "image":
        numbers = _pair_by_name(imports, samples, known)
    elif chosen == "sample":
        numbers = [row.sample for row in rows]
    elif chosen == "stamp_s":
        numbers = _pair_by_time(rows, waiting)
    else:
        numbers = _pair_by_order(imports, waiting)
    _check_unique(imports, numbers)
    paired = set(numbers)
    return Pairing(
        chosen,
        tuple(numbers),
        tuple(_name(row, i) for i, row in enumerate(rows) if numbers[i] is None),
        tuple(sample.sample for sample in waiting if sample.sample not in paired),
    )


def samples_without_content(rows: Sequence[Row], samples: Sequence[Sample]) -> list[Sample]:
    """Samples without any content of the rows.

    If the rows have views and repeat the recorded robot states, only the views count as content.
    """
    has_same_states = len(rows) == len(samples) and all(
        is_same_state(row.robots[name], sample.robots[name])
        for row, sample in zip(rows, samples, strict=True)
        for name in row.robots.keys() & sample.robots.keys()
    )
    content = _content_names(rows)
    views = {name for name in content if not name.startswith(_ROBOT)} if has_same_states else content
    return [sample for sample in samples if not (views or content) & _content_names([sample])]


def _samples_of_carrier(imports: Imported, samples: Sequence[Sample]) -> Sequence[Sample]:
    """Samples with a robot that carries an imported camera, if their number equals that of the rows; otherwise all."""
    carriers = {camera.get("on") for camera in imports.cell.get("cameras", {}).values()}
    own = [sample for sample in samples if carriers & sample.robots.keys()]
    return own if len(own) == len(imports.rows) else samples


def _own_samples(imports: Imported, samples: Sequence[Sample]) -> Pairing:
    """Pair all rows with new samples, numbered after the recorded ones.

    Raises:
        InputError: if the rows are, or may be, recorded already.
    """
    recorded = sorted(_content_names(imports.rows) & _content_names(samples))
    is_whole = all(row.robots and (row.observations or row.images) for row in imports.rows)
    is_apart = imports.is_session or (is_whole and not imports.is_stream)
    if recorded and (not is_apart or _holds_copies(imports.rows, samples)):
        do = "add --session for other samples, or --replace for better ones"
        if imports.is_session:
            do = "nothing needs to be imported"
        raise InputError(f"{imports.source}: {list_names(recorded)} is recorded already: {do}")
    if recorded and imports.is_stream:
        _check_times(imports, samples)
    first = max((sample.sample for sample in samples), default=-1) + 1
    return Pairing("sample", tuple(range(first, first + len(imports.rows))))


def _holds_copies(rows: Sequence[Row], samples: Sequence[Sample]) -> bool:
    """Whether every row with robots and views is a copy of a recorded sample."""
    whole = [row for row in rows if row.robots and row.observations]
    return bool(whole) and all(
        any(
            row.robots.keys() <= sample.robots.keys()
            and _content_names([row]) <= _content_names([sample])
            and all(is_same_state(state, sample.robots[name]) for name, state in row.robots.items())
            for sample in samples
        )
        for row in whole
    )


def is_same_state(state: RobotState, recorded_state: RobotState, tolerance: float = _STATE_TOLERANCE) -> bool:
    """Whether two states of a robot are equal within `tolerance` [m, rad], by default the rounding of files."""
    is_one_kind = (state.joints_rad is None) == (recorded_state.joints_rad is None)
    return is_one_kind and np.allclose(state.vector, recorded_state.vector, rtol=0, atol=tolerance)


def _check_times(imports: Imported, samples: Sequence[Sample]) -> None:
    """Check that the times of a stream do not overlap the recorded ones, because streams are joined by time.

    Raises:
        InputError: if they overlap.
    """
    rows = [row.stamp_s for row in imports.rows if row.stamp_s is not None]
    stamps = [sample.stamp_s for sample in samples if sample.stamp_s is not None]
    if rows and stamps and min(rows) <= max(stamps) and min(stamps) <= max(rows):
        raise InputError(
            f"{imports.source}: its times lie within those that are recorded, by which streams are joined. "
            "Import into another folder, or shift them"
        )


def _content_names(lines: Sequence[Row | Sample]) -> set[str]:
    """Descriptions of the content of rows or samples: robots, views and images."""
    found = {f"{_ROBOT} {name!r}" for line in lines for name in line.robots}
    found |= {f"target {o.target!r} seen by {o.camera!r}" for line in lines for o in line.observations}
    return found | {f"camera {name!r}" for line in lines for name in line.images}


def _pairing_method(rows: Sequence[Row], samples: Sequence[Sample], numbers: Mapping[str, int]) -> PairingMethod:
    """Method for which all rows have a key; `numbers` are the known sample numbers by image name."""
    names = {plain_name(row.image) for row in rows if row.image is not None}
    # A table with other image names belongs to other samples; a folder of another camera may have the same order.
    is_named_table = numbers and not any(row.images for row in rows)
    if rows and all(row.image is not None for row in rows) and (is_named_table or names & numbers.keys()):
        return "image"
    if rows and all(row.sample is not None for row in rows):
        return "sample"
    has_times = all(row.stamp_s is not None for row in rows) and all(s.stamp_s is not None for s in samples)
    return "stamp_s" if rows and samples and has_times else "order"


def _pair_by_name(imports: Imported, samples: Sequence[Sample], samples_by_name: Mapping[str, int]) -> list[int | None]:
    """Sample numbers of rows by image name; new numbers if no name is known, as for another camera's images."""
    numbers = [samples_by_name.get(plain_name(row.image or "")) for row in imports.rows]
    if any(number is not None for number in numbers):
        return numbers
    if not samples_by_name:
        raise InputError(
            f"{imports.source}: the recording names no images to pair by. Omit `--by name` to pair in "
            "order, or import tables with a column `image` into another folder"
        )
    first = max(sample.sample for sample in samples) + 1
    return list(range(first, first + len(imports.rows)))


def _pair_by_order(imports: Imported, samples: Sequence[Sample]) -> list[int | None]:
    if len(imports.rows) != len(samples):
        counts = f"{imports.source} holds {len(imports.rows)}, the recording has {count_text(len(samples), 'sample')}"
        gaps = missing_numbers([row.image for row in imports.rows if row.image is not None])
        counts = f"{list_names(gaps)} missing in the numbering of its images; {counts}" if gaps else counts
        raise InputError(
            f"{counts} without it. Row i belongs to sample i, unless a table's column `image` or `sample`, or --by "
            "name of images, states otherwise. Give --session if it was recorded separately, --still for one row"
        )
    return [sample.sample for sample in samples]


def _pair_by_time(rows: Sequence[Row], samples: Sequence[Sample]) -> list[int | None]:
    """Sample numbers of rows by time: mutual nearest neighbours within LARGEST_DIFFERENCE_S; None otherwise.

    Raises:
        InputError: if no sample has a time, or none is near a row's.
    """
    timed = [sample for sample in samples if sample.stamp_s is not None]
    if not timed:
        raise InputError("no recorded sample has a time to pair by: omit `--by time` to pair in order")
    sample_times = np.array([sample.stamp_s for sample in timed], dtype=np.float64)
    row_times = np.array([row.stamp_s for row in rows], dtype=np.float64)
    numbers: list[int | None] = [None] * len(rows)
    for i, row_time in enumerate(row_times):
        k = int(np.argmin(np.abs(sample_times - row_time)))
        is_mutual = i == int(np.argmin(np.abs(row_times - sample_times[k])))
        if is_mutual and abs(sample_times[k] - row_time) <= LARGEST_DIFFERENCE_S:
            numbers[i] = timed[k].sample
    if not any(number is not None for number in numbers):
        spans = (
            f"{row_times.min():g} to {row_times.max():g} s, "
            f"the samples' from {sample_times.min():g} to {sample_times.max():g} s"
        )
        raise InputError(
            f"no time of a row is within {LARGEST_DIFFERENCE_S} s of a sample's: the rows' are from {spans}"
        )
    return numbers


def _check_unique(imports: Imported, numbers: Sequence[int | None]) -> None:
    first: dict[int, int] = {}
    for i, number in enumerate(numbers):
        if number is not None and first.setdefault(number, i) != i:
            row_names = list_names([_name(imports.rows[first[number]], first[number]), _name(imports.rows[i], i)])
            raise InputError(f"{imports.source}: two rows belong to sample {number} ({row_names}); keep one")


def _name(row: Row, index: int) -> str:
    if row.image is not None:
        return row.image
    return f"row {index + 1}" if row.stamp_s is None else f"row {index + 1} ({row.stamp_s:.3f} s)"


def plain_name(name: str) -> str:
    """An image's name without folders and extension, which differ between programs."""
    return PurePosixPath(name.replace("\\", "/")).stem
