"""Tests of LeRobot tables in the sandbox: a small file that claims more data than fits memory uses little of it."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from basecal.errors import InputError
from exchange.test_lerobot import dataset

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")
lerobot_boxed = pytest.importorskip("basecal.exchange.lerobot_boxed")

COLUMNS = "timestamp,observation.state"
_MOTORS = 7
READS = """
import resource, sys
from pathlib import Path
from basecal.errors import DatasetError
from basecal.exchange.lerobot import read_episode
try:
    read_episode(Path(sys.argv[1]), 5)
except DatasetError as error:
    print(error)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""


def run_lengths(folder: Path, rows: int, groups: int = 1, numbers: int = _MOTORS) -> str:
    """Write a dataset of zeros, which Parquet stores as their count, and return its table."""
    dataset(folder, [f"motor{k}" for k in range(_MOTORS)])
    path = folder / "data" / "chunk-000" / "zeros.parquet"
    states = pa.ListArray.from_arrays(
        np.arange(0, numbers * rows + 1, numbers, dtype=np.int32), np.zeros(numbers * rows, np.float32)
    )
    columns = [states, np.zeros(rows, np.float32), np.zeros(rows, np.int64)]
    table = pa.table(columns, names=["observation.state", "timestamp", "episode_index"])
    with pq.ParquetWriter(path, table.schema, compression="zstd") as writer:
        for _ in range(groups):
            writer.write_table(table)
    return str(path)


def test_rows_are_read_in_batches(tmp_path: Path) -> None:
    """Rows are read in batches, however many a group has; for a missing episode only its numbers."""
    path = run_lengths(tmp_path, 40_000)
    frames = list(lerobot_boxed.read_frames(["0", COLUMNS, path]))
    assert [len(content) // 8 // (1 + _MOTORS) for _, content in frames] == [2**14, 2**14, 40_000 - 2**15]
    assert list(lerobot_boxed.read_frames(["3", COLUMNS, path])) == [([0, 0, 0], b"")] * 3
    assert list(lerobot_boxed.read_frames(["0", COLUMNS, run_lengths(tmp_path / "none", 0)])) == []


def test_row_count_is_checked_before_reading(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The table's own row count is checked before any row is read."""
    path = run_lengths(tmp_path, 1000)
    monkeypatch.setattr(lerobot_boxed, "_MOST_ROWS", 999)
    monkeypatch.setattr(lerobot_boxed.ParquetFile, "iter_batches", None)
    with pytest.raises(InputError, match="has more than 999 rows; cut it"):
        list(lerobot_boxed.read_frames(["0", COLUMNS, path]))


@pytest.mark.parametrize(
    ("state", "stamp", "episode"),
    [
        ([[1.0], [2.0, 3.0]], [0.0, 1.0], [0, 0]),
        ([[1.0], None], [0.0, 1.0], [0, 0]),
        ([[], []], [0.0, 1.0], [0, 0]),
        ([[1.0], [None]], [0.0, 1.0], [0, 0]),
        (["a", "b"], [0.0, 1.0], [0, 0]),
        ([[[1.0]], [[2.0]]], [0.0, 1.0], [0, 0]),
        ([{"a": 1.0}, {"a": 2.0}], [0.0, 1.0], [0, 0]),
        ([[1.0], [2.0]], [0.0, None], [0, 0]),
        ([[1.0], [2.0]], [0.0, 1.0], ["a", "b"]),
        (None, [0.0, 1.0], [0, 0]),
    ],
)
def test_invalid_lerobot_columns_are_refused(tmp_path: Path, state: object, stamp: object, episode: object) -> None:
    """Rows of unequal length, nulls, text, nested lists and a missing column are errors of the file."""
    columns = {"timestamp": stamp, "episode_index": episode} | ({} if state is None else {"observation.state": state})
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table(columns), path)
    with pytest.raises(
        InputError, match=r"a\.parquet: not a table of LeRobot \(\w+\), expected timestamp, observation\.state"
    ):
        list(lerobot_boxed.read_frames(["0", COLUMNS, str(path)]))


def test_stamps_may_be_lists_of_one(tmp_path: Path) -> None:
    """Some versions write each stamp as a list of one."""
    columns = {"observation.state": [[1, 2], [3, 4]], "timestamp": [[0.0], [0.5]], "episode_index": [0, 0]}
    pq.write_table(pa.table(columns), tmp_path / "a.parquet")
    ((sizes, content),) = lerobot_boxed.read_frames(["0", COLUMNS, str(tmp_path / "a.parquet")])
    assert sizes == [3, 0, 0]
    np.testing.assert_array_equal(np.frombuffer(content).reshape(2, 3), [[0, 1, 2], [0.5, 3, 4]])


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="needs the most memory that a process had [kB]")
@pytest.mark.parametrize(("rows", "groups", "numbers"), [(200_000, 60, _MOTORS), (4, 3, 20_000_000)])
def test_run_lengths_use_little_memory(tmp_path: Path, rows: int, groups: int, numbers: int) -> None:
    """Twelve million frames in 0.2 MB took 6 GB, and three rows of very many numbers would, too."""
    path = run_lengths(tmp_path, rows, groups, numbers)
    assert Path(path).stat().st_size < 10**6
    # A separate process, whose only child is the reader.
    output = subprocess.run(
        [sys.executable, "-c", READS, str(tmp_path)], capture_output=True, text=True, check=True
    ).stdout
    message, kilobytes = output.splitlines()
    assert re.search(r"has no episode 5|more memory", message)
    assert int(kilobytes) < 2**20
