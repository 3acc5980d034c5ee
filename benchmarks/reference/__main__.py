"""Compare answers with the reference, or store them as the reference."""

from __future__ import annotations

import argparse
import gzip
import json
import re
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from benchmarks.reference import __doc__ as description
from benchmarks.reference.answers import Answer, answer, differences
from benchmarks.reference.cases import cases

HERE = Path(__file__).parent
STORED, EXPLAINED = HERE / "answers.jsonl.gz", HERE / "explained.yaml"


def answers(names: list[str], jobs: int) -> Iterator[tuple[str, Answer]]:
    """Each case with its answer as it comes; progress goes to the error stream."""
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for done, (name, result) in enumerate(zip(names, pool.map(answer, names, chunksize=4), strict=True), start=1):
            print(f"\r{done} of {len(names)}", end="", file=sys.stderr)
            yield name, result
    print(file=sys.stderr)


def read_reference() -> dict[str, Answer]:
    """The stored answers by case."""
    with gzip.open(STORED, "rt", encoding="utf-8") as file:
        return dict(json.loads(line) for line in file)


def store(answers: Mapping[str, Answer]) -> None:
    """Write the reference; cases that were not calibrated again keep their answers."""
    kept = {**(read_reference() if STORED.exists() else {}), **answers}
    lines = (json.dumps(pair, separators=(",", ":")) + "\n" for pair in sorted(kept.items()))
    STORED.write_bytes(gzip.compress("".join(lines).encode(), mtime=0))


def reason(explained: list[dict[str, str]], line: str) -> str:
    """The reason of an intended difference; empty if none is given."""
    return next((each["because"] for each in explained if re.search(each["lines"], line)), "")


def report(after: Mapping[str, Answer], before: Mapping[str, Answer], explained: list[dict[str, str]]) -> int:
    """Print each difference, and return the number of unexplained ones."""
    lines = [f"{name}: {each}" for name in after if name in before for each in differences(before[name], after[name])]
    lines += [f"{name}: not in the reference" for name in after if name not in before]
    meant = {line: why for line in lines if (why := reason(explained, line))}
    for line in lines:
        print(line + (f"  [{meant[line]}]" if line in meant else ""))
    differ = len({line.split(":")[0] for line in lines})
    print(f"{len(after)} cases, {len(after) - differ} equal, {len(lines)} differences, {len(meant)} of them explained")
    return len(lines) - len(meant)


def main() -> int:
    """Compare or store; return 1 if a difference is not explained."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.reference", description=description)
    parser.add_argument("--store", action="store_true", help="store the answers as the reference")
    parser.add_argument("--only", default="", metavar="PATTERN", help="cases whose name matches")
    parser.add_argument("--every", type=int, default=1, metavar="K", help="each K-th case")
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    names = [name for name in cases() if re.search(asked.only, name)][:: asked.every]
    results = dict(answers(names, asked.jobs))
    if asked.store:
        store(results)
        return 0
    listed: Any = YAML(typ="safe", pure=True).load(EXPLAINED)
    return int(report(results, read_reference(), listed or []) > 0)


if __name__ == "__main__":
    sys.exit(main())
