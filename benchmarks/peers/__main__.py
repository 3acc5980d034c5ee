"""Command: python -m benchmarks.peers."""

from __future__ import annotations

import argparse
import sys
import time
from typing import Any, get_args

import cv2
from threadpoolctl import threadpool_limits

from benchmarks.common import on_one_core, write
from benchmarks.peers import tables
from benchmarks.peers.task import Design, DesignName, designs
from benchmarks.peers.trial import summary, trial

NAMES: tuple[DesignName, ...] = get_args(DesignName)
CELLS = 40


def run(design: Design, cells: int, first_seed: int) -> dict[str, Any]:
    """A row of results, with the seconds it took."""
    began = time.perf_counter()
    trials = [trial(design, seed) for seed in range(first_seed, first_seed + cells)]
    return {**summary(design, trials), "seconds": time.perf_counter() - began}


def main(arguments: list[str]) -> None:
    """Run, print; with all designs write results/peers.json too."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.peers", description=__doc__)
    parser.add_argument("--cells", type=int, default=CELLS, help=f"of each row (default {CELLS})")
    parser.add_argument("--designs", nargs="*", default=list(NAMES), choices=NAMES, metavar="NAME")
    parser.add_argument("--first-seed", type=int, default=0)
    asked = parser.parse_args(arguments)
    on_one_core()
    cv2.setNumThreads(1)
    rows = []
    with threadpool_limits(1):
        for design in [each for name in asked.designs for each in designs(name)]:
            rows.append(run(design, asked.cells, asked.first_seed))
            print(f"{rows[-1]['seconds']:5.0f} s  {design}", flush=True)
    print("\n" + tables.text(rows))
    missed = tables.missed_goals(rows)
    print("\nmissed:\n" + "\n".join(missed or ["nothing"]))
    if asked.designs == list(NAMES) and asked.cells >= CELLS:
        settings = {"first_seed": asked.first_seed, "times": tables.TIMES}
        write("peers", {**settings, "cells": asked.cells, "rows": rows, "missed": missed})


if __name__ == "__main__":
    main(sys.argv[1:])
