"""Whether the solver ends, without a guess, at the optimum that it reaches from the truth."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
from tests.shared.kinds import KINDS
from tests.shared.start_trial import Trial, trial

from benchmarks.common import table, write

TARGET = 0.995


def run(kinds: Iterable[str], cells: int, first_seed: int, workers: int) -> list[Trial]:
    """`cells` trials, divided evenly among the kinds."""
    names = list(kinds)
    cases = [(names[k % len(names)], first_seed + k // len(names)) for k in range(cells)]
    if workers == 1:
        return [trial(*each) for each in cases]
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        return list(pool.map(trial, *zip(*cases, strict=True), chunksize=4))


def _summary(name: str, trials: list[Trial]) -> dict[str, Any]:
    count = {verdict: sum(t.verdict == verdict for t in trials) for verdict in ("same", "other", "unseen")}
    judged = count["same"] + count["other"]
    return {
        "kind": name,
        **count,
        "rate": count["same"] / judged if judged else None,
        "median_ms": 1e3 * float(np.median([t.seconds for t in trials])),
        "slowest_ms": 1e3 * max(t.seconds for t in trials),
        "failing": [[t.kind, t.seed] for t in trials if t.verdict == "other"],
        "unseen_seeds": [[t.kind, t.seed] for t in trials if t.verdict == "unseen"],
    }


def summaries(trials: list[Trial]) -> list[dict[str, Any]]:
    """Statistics by kind, and over all."""
    kinds = dict.fromkeys(t.kind for t in trials)
    return [*(_summary(k, [t for t in trials if t.kind == k]) for k in kinds), _summary("all", trials)]


def _report(summaries: list[dict[str, Any]]) -> str:
    rows = []
    for s in summaries:
        rate = "" if s["rate"] is None else f"{100 * s['rate']:.2f} %"
        seeds = "" if s["kind"] == "all" else " ".join(str(seed) for _, seed in s["failing"])
        times = f"{s['median_ms']:.0f}", f"{s['slowest_ms']:.0f}"
        rows.append((s["kind"], s["same"], s["other"], s["unseen"], rate, *times, seeds))
    head = ("kind", "same optimum", "another", "not observable", "rate", "median [ms]", "slowest [ms]", "failing seeds")
    return table(head, rows)


def main(arguments: list[str]) -> None:
    """Run, print, write results/starts.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.starts", description=__doc__)
    parser.add_argument("--cells", type=int, default=1000)
    parser.add_argument("--kinds", nargs="*", default=list(KINDS), choices=list(KINDS), metavar="KIND")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args(arguments)
    trials = run(asked.kinds, asked.cells, asked.first_seed, asked.workers)
    rows = summaries(trials)
    print(_report(rows))
    failures = [t for t in trials if t.verdict == "other"]
    for t in failures:
        print(f"{t.kind}, seed {t.seed}: cost {t.cost:.6g}, from the truth {t.cost_from_truth:.6g}, off by {t.off:.2g}")
    rate = rows[-1]["rate"]
    result = {"cells": asked.cells, "first_seed": asked.first_seed, "target": TARGET, "rate": rate, "kinds": rows}
    print(f"\nwritten: {write('starts', {**result, 'others': [t._asdict() for t in failures]}).name}")


if __name__ == "__main__":
    main(sys.argv[1:])
