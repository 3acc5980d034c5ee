"""Shared by the benchmarks: one thread, tables, and files of results."""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import subprocess
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

RESULTS = Path(__file__).parent / "results"
_TERMS = {
    "a light": "an LED",
    "light": "LED",
    "a picture": "an image",
    "picture": "image",
    "pictures": "images",
    "in common": "shared",
}


def on_one_core() -> None:
    """Pin this process to one core, whatever the threads of its libraries; a second process may get another core."""
    if hasattr(os, "sched_setaffinity"):
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {cores[os.getpid() % len(cores)]})


def seconds(work: Callable[[], object]) -> float:
    """Wall time of one call [s]."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def cpu_seconds(work: Callable[[], object]) -> float:
    """CPU time of one call in this process of one thread [s]."""
    start = time.process_time()
    work()
    return time.process_time() - start


def interleave_times(works: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, list[float]]:
    """Times [s] of each work, all in turn each round, so that a slow moment of the machine affects all of them."""
    times: dict[str, list[float]] = {name: [] for name in works}
    for work in works.values():
        work()
    for _ in range(repeats):
        for name, work in works.items():
            times[name].append(seconds(work))
    return times


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A markdown table."""
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines)


def label(name: str) -> str:
    """The name of a row in the words of the page; stored results may have an older word."""
    for old, new in _TERMS.items():
        name = re.sub(rf"\b{old}\b", new, name)
    return name


def machine() -> dict[str, str | int | None]:
    """Versions and processor of this machine."""
    return {"python": platform.python_version(), "numpy": np.__version__, "cores": os.cpu_count(), "cpu": _cpu()}


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.machine())


def commit() -> str | None:
    """The short hash of the commit that is checked out; None outside a checkout."""
    command = ["git", "-C", str(RESULTS.parent), "rev-parse", "--short", "HEAD"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return None


def write(name: str, result: Mapping[str, Any]) -> Path:
    """Write results/<name>.json, with the machine it was measured on and the commit."""
    RESULTS.mkdir(exist_ok=True)
    path = RESULTS / f"{name}.json"
    content = {"machine": machine(), "commit": commit(), **result}
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    return path


def read(name: str) -> dict[str, Any]:
    """The content of results/<name>.json."""
    result: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
    return result


class Kept:
    """Values by key that are kept in a file, a line each, so that a run can continue an earlier one."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        lines = path.read_text(encoding="utf-8").splitlines() if path is not None and path.exists() else []
        self._known: dict[str | int, Any] = dict(json.loads(line) for line in lines)

    def __contains__(self, key: object) -> bool:
        return key in self._known

    def items(self) -> Iterable[tuple[Any, Any]]:
        """Keys with their values."""
        return self._known.items()

    def get(self, key: str | int) -> Any:
        """The value of a key; None if nothing is kept."""
        return self._known.get(key)

    def keep(self, key: str | int, value: Any) -> Any:
        """Keep a value in the file, and return it."""
        self._known[key] = value
        if self._path is not None:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps([key, value]) + "\n")
        return value

    def of(self, key: str | int, measure: Callable[[], Any]) -> Any:
        """The value of a key, measured and kept if there is none yet."""
        return self._known[key] if key in self._known else self.keep(key, measure())


def run_draws(
    name: str,
    arguments: Sequence[str],
    usual: tuple[int, int],
    measure: Callable[[int, int], Mapping[str, Any]],
    format_result: Callable[[Mapping[str, Any]], str],
) -> None:
    """Measure draws of samples and print; with at least the usual number of draws write the results too."""
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks.{name}")
    parser.add_argument("--draws", type=int, default=usual[0])
    parser.add_argument("--samples", type=int, default=usual[1])
    asked = parser.parse_args(arguments)
    on_one_core()
    result = measure(asked.draws, asked.samples)
    print(format_result(result))
    if asked.draws >= usual[0]:
        write(name, {"draws": asked.draws, "samples": asked.samples, **result})


def run_cells(
    name: str,
    arguments: Sequence[str],
    cells: int,
    measure: Callable[[int], Iterable[dict[str, Any]]],
    format_rows: Callable[[list[dict[str, Any]]], str],
    make_result: Callable[[list[dict[str, Any]]], Mapping[str, Any]] = lambda rows: {"rows": rows},
) -> None:
    """Measure cells by their seeds and print; with all `cells` write the results too.

    With `--keep FILE` each measured cell is a line of that file, and is not measured again. The results then hold the
    cells there are, and the page gives their number.
    """
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks.{name}")
    parser.add_argument("--cells", type=int, default=cells)
    parser.add_argument("--keep", type=Path, help="file in which cells are kept, and from which a run goes on")
    asked = parser.parse_args(arguments)
    on_one_core()
    kept = Kept(asked.keep)
    rows = [each for seed in range(asked.cells) for each in kept.of(seed, lambda seed=seed: list(measure(seed)))]
    print(format_rows(rows))
    if asked.keep is not None or asked.cells >= cells:
        write(name, make_result(rows))
