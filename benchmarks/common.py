"""What the benchmarks share: one thread, tables, and files of results."""

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
    """Keep this process on one core, whatever its libraries' threads would like; two processes need not share it."""
    if hasattr(os, "sched_setaffinity"):
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {cores[os.getpid() % len(cores)]})


def seconds(work: Callable[[], object]) -> float:
    """Wall time of one call [s]."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def cpu_seconds(work: Callable[[], object]) -> float:
    """Time that this process, of one thread, computes in one call [s]: that of the call where nothing else runs."""
    start = time.process_time()
    work()
    return time.process_time() - start


def interleaved(works: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, list[float]]:
    """Times [s] of each work, all of them once a round, so that a slow moment of the machine meets all alike."""
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
    """The name of a row as the page has it; stored results and their keys may have an older word."""
    for old, new in _TERMS.items():
        name = re.sub(rf"\b{old}\b", new, name)
    return name


def machine() -> dict[str, str | int | None]:
    """On what it was measured."""
    return {"python": platform.python_version(), "numpy": np.__version__, "cores": os.cpu_count(), "cpu": _cpu()}


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.machine())


def commit() -> str | None:
    """The commit that is checked out, short; None outside a checkout."""
    asked = ["git", "-C", str(RESULTS.parent), "rev-parse", "--short", "HEAD"]
    try:
        return subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return None


def write(name: str, result: Mapping[str, Any]) -> Path:
    """Write results/<name>.json, with the machine it was measured on and the commit."""
    RESULTS.mkdir(exist_ok=True)
    path = RESULTS / f"{name}.json"
    told = {"machine": machine(), "commit": commit(), **result}
    path.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    return path


def read(name: str) -> dict[str, Any]:
    """What results/<name>.json holds."""
    found: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
    return found


class Kept:
    """Outcomes that are kept in a file as they come, a line each, by what was tried."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        lines = path.read_text(encoding="utf-8").splitlines() if path is not None and path.exists() else []
        self._known: dict[str | int, Any] = dict(json.loads(line) for line in lines)

    def __contains__(self, key: object) -> bool:
        return key in self._known

    def of(self, key: str | int, measured: Callable[[], Any]) -> Any:
        """What was kept by this key; where nothing was, what is measured, kept from now on."""
        if key not in self._known:
            self._known[key] = measured()
            if self._path is not None:
                with self._path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps([key, self._known[key]]) + "\n")
        return self._known[key]


def by_draws(
    name: str,
    arguments: Sequence[str],
    usual: tuple[int, int],
    measured: Callable[[int, int], Mapping[str, Any]],
    shown: Callable[[Mapping[str, Any]], str],
) -> None:
    """Measure draws of samples and print; results of at least the usual number of draws are written, too."""
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks.{name}")
    parser.add_argument("--draws", type=int, default=usual[0])
    parser.add_argument("--samples", type=int, default=usual[1])
    asked = parser.parse_args(arguments)
    on_one_core()
    found = measured(asked.draws, asked.samples)
    print(shown(found))
    if asked.draws >= usual[0]:
        write(name, {"draws": asked.draws, "samples": asked.samples, **found})


def cell_by_cell(
    name: str,
    arguments: Sequence[str],
    cells: int,
    measured: Callable[[int], Iterable[dict[str, Any]]],
    shown: Callable[[list[dict[str, Any]]], str],
    result: Callable[[list[dict[str, Any]]], Mapping[str, Any]] = lambda found: {"rows": found},
) -> None:
    """Measure cells by their seeds and print; of all `cells` the results are written, too.

    With `--keep FILE` each cell is a line of that file once it is measured, and is not measured again. The results are
    then written of as many cells as there are: the page tells how many.
    """
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks.{name}")
    parser.add_argument("--cells", type=int, default=cells)
    parser.add_argument("--keep", type=Path, help="file in which cells are kept, and from which a run goes on")
    asked = parser.parse_args(arguments)
    on_one_core()
    kept = Kept(asked.keep)
    found = [each for seed in range(asked.cells) for each in kept.of(seed, lambda seed=seed: list(measured(seed)))]
    print(shown(found))
    if asked.keep is not None or asked.cells >= cells:
        write(name, result(found))
