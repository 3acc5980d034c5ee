"""Subprocess that reads the tables of a LeRobot dataset: rows of one episode, in batches.

The arguments are the episode, the columns and the tables.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from pyarrow.parquet import ParquetFile

from basecal.box import Frame, is_own_fault
from basecal.errors import InputError
from basecal.geometry import Array

_EPISODE = "episode_index"
_MOST_ROWS = 20_000_000  # limit of a table: 100 hours at 50 Hz
_BATCH_ROWS = 2**14


def read_frames(words: Sequence[str]) -> Iterator[Frame]:
    """Frames `[numbers per row, first episode, last episode]` of batches, with the numbers of the episode's rows."""
    pa.set_memory_pool(pa.system_memory_pool())  # other memory pools reserve more than they use
    columns = words[1].split(",")
    for path in words[2:]:
        try:
            yield from _frames(path, int(words[0]), columns)
        except (MemoryError, InputError):
            raise
        except Exception as error:  # Arrow raises many types of errors
            if is_own_fault(error):
                raise
            expected = f"expected {', '.join(columns)} and {_EPISODE}"
            raise InputError(f"{path}: not a table of LeRobot ({type(error).__name__}), {expected}") from None


def _frames(path: str, episode: int, columns: Sequence[str]) -> Iterator[Frame]:
    table = ParquetFile(path)
    if table.metadata.num_rows > _MOST_ROWS:
        raise InputError(f"{path}: has more than {_MOST_ROWS} rows; cut it")
    for batch in table.iter_batches(_BATCH_ROWS, columns=[*columns, _EPISODE], use_threads=False):
        episodes = _numbers(batch, _EPISODE)[:, 0]
        of_episode = batch.filter(pa.array(episodes == episode))
        rows = (
            np.column_stack([_numbers(of_episode, name) for name in columns]) if len(of_episode) else np.zeros((0, 0))
        )
        yield [rows.shape[1], int(episodes.min()), int(episodes.max())], rows.tobytes()


def _numbers(batch: pa.RecordBatch, name: str) -> Array:
    """Read a column of numbers or of lists of equal length, (rows, numbers per row).

    Raises:
        ArrowException: if the column holds anything else.
    """
    column = batch.column(name)
    is_list = column.type.num_fields > 0
    widths = pc.unique(pc.list_value_length(column)).to_pylist() if is_list else [1]
    values = column.flatten() if is_list else column
    if len(widths) != 1 or not widths[0] or values.null_count:
        raise pa.ArrowInvalid(f"{name}: rows of {widths} numbers, {values.null_count} of them missing")
    numbers: Array = values.cast(pa.float64()).to_numpy(zero_copy_only=False)
    return numbers.reshape(len(column), -1)
