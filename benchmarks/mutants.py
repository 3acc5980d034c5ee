"""How many small faults in the sources the tests of their own room find.

A mutant is one source file with one expression changed: a comparison turned round or shifted by its border, an
operator exchanged, a condition negated, a number changed. Its room is the folder of the tests that mirrors the folder
of the file; only these tests judge it, those under the file's own name first. The sample is drawn with a seed; a
mutant that a test fails on, or that makes the tests hang, is killed. `benchmarks/results/mutants.json` keeps the last
run of each choice of packages and lists what survived; `benchmarks/surviving_mutants.py` says why.

Every mutant is judged in a fork of one process that has the libraries loaded but nothing of the package, with a copy
of the sources in which that file is changed: nothing of the work tree is touched.
"""

from __future__ import annotations

import argparse
import ast
import copy
import json
import os
import shutil
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import pytest

from benchmarks.common import RESULTS, commit, table, write
from benchmarks.surviving_mutants import reason

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "basecal"
TESTS = ROOT / "tests"
PACKAGES = ("geometry", "numerics", "kinematics", "cell", "estimation", "accuracy")
SLOWER = 5.0  # a mutant that takes so many times as long as its room does without one is taken to hang
LONGEST_S = 600.0
HEAD = ("room", "mutants", "killed", "equivalent", "killed of the others")
HEAD_OF_SURVIVORS = ("survived", "was", "became", "why")
NICE = 10

COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE,
    ast.LtE: ast.Gt,
    ast.Gt: ast.LtE,
    ast.GtE: ast.Lt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
BORDERS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
}
OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}


class Mutant(NamedTuple):
    """One change: the file below `src/basecal`, the line, what stood and what stands there, the new source."""

    file: str
    line: int
    old: str
    new: str
    source: str


class Verdict(NamedTuple):
    """What became of a mutant: `killed`, `hung` or `survived`."""

    mutant: Mutant
    end: str


def changed(node: ast.AST) -> Iterator[ast.AST]:
    """All that a node may be replaced by."""
    match node:
        case ast.Compare(left=left, ops=[op], comparators=right):
            if type(op) in COMPARISONS:
                yield ast.Compare(left, [COMPARISONS[type(op)]()], right)
            if type(op) in BORDERS and (_counts(left) or _counts(right[0])):
                yield ast.Compare(left, [BORDERS[type(op)]()], right)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS and not _is_text(left):
            yield ast.BinOp(left, OPERATORS[type(op)](), right)
        case ast.BoolOp(op=op, values=values):
            yield ast.BoolOp(ast.Or() if isinstance(op, ast.And) else ast.And(), values)
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            yield operand
        case ast.IfExp(test=test, body=body, orelse=other):
            yield ast.IfExp(test, other, body)
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield ast.Constant(value + 1)
        case ast.Constant(value=float(value)):
            yield ast.Constant(10 * value if value else 1.0)


def _counts(node: ast.AST) -> bool:
    """Whether something is a count by its form: between real numbers a border makes no difference."""
    match node:
        case ast.Constant(value=int()) | ast.Call(func=ast.Name(id="len")):
            return True
    return False


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _places(tree: ast.AST) -> Iterator[tuple[ast.AST, str, int | None]]:
    """Every expression of the code by its parent, field and place; no annotation, decorator or message of an error."""
    for field, value in ast.iter_fields(tree):
        if field in {"annotation", "returns", "decorator_list", "type_params"} or isinstance(tree, ast.Raise):
            continue
        for place, child in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if isinstance(child, ast.AST) and not _is_declaration(child):
                yield tree, field, place
                yield from _places(child)


def _is_declaration(node: ast.AST) -> bool:
    """Whether a node is for type checkers alone, is text, or asserts what holds by construction."""
    match node:
        case ast.If(test=ast.Name(id="TYPE_CHECKING")) | ast.JoinedStr() | ast.keyword(arg="strict"):
            return True
        case ast.Assign(targets=[ast.Name(id=name)], value=ast.Subscript(value=ast.Name(id=kind))):
            return name[:1].isupper() and kind in {"Literal", "Callable", "Mapping", "NDArray", "tuple", "dict"}
    return False


def mutants_of(path: Path) -> Iterator[Mutant]:
    """Every mutant of a file, in the order of its text."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for parent, field, place in _places(tree):
        holder = getattr(parent, field)
        node = holder if place is None else holder[place]
        for other in changed(node):
            new = ast.copy_location(copy.deepcopy(other), node)
            _put(parent, field, place, new)
            source = ast.unparse(ast.fix_missing_locations(tree))
            _put(parent, field, place, node)
            yield Mutant(str(path.relative_to(SOURCE)), node.lineno, ast.unparse(node), ast.unparse(new), source)


def _put(parent: ast.AST, field: str, place: int | None, node: ast.AST) -> None:
    if place is None:
        setattr(parent, field, node)
    else:
        getattr(parent, field)[place] = node


def room_tests(file: str) -> list[Path]:
    """The tests of a file's room: those under its own name first."""
    folder = TESTS / Path(file).parent
    own = folder / f"test_{Path(file).name}"
    return sorted(folder.glob("test_*.py"), key=lambda path: (path != own, path.name))


def judged(sources: Path, tests: Sequence[Path], limit_s: float) -> str:
    """Run tests on a copy of the sources in a fork: `survived` where all pass, `killed` or `hung`."""
    child = os.fork()
    if child == 0:
        _run(sources, tests)
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return "survived" if os.waitstatus_to_exitcode(status) == 0 else "killed"
        time.sleep(0.02)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return "hung"


def _run(sources: Path, tests: Sequence[Path]) -> None:
    silence = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(silence, stream)
    sys.path.insert(0, str(sources))
    os.environ["PYTHONPATH"] = str(sources)
    quiet = [
        "-x",
        "-q",
        "--assert=plain",
        "-m",
        "not slow",
        "-p",
        "no:cacheprovider",
        "-p",
        "no:xdist",
        "--rootdir",
        str(ROOT),
    ]
    os._exit(int(pytest.main([*quiet, *map(str, tests)])))


def sample_of(packages: Sequence[str], count: int, seed: int) -> list[Mutant]:
    """So many mutants of all that there are in some packages, drawn without putting back."""
    paths = [path for name in packages for path in sorted((SOURCE / name).rglob("*.py")) if path.name != "__init__.py"]
    every = [mutant for path in paths for mutant in mutants_of(path)]
    chosen = np.random.default_rng(seed).permutation(len(every))[:count]
    return [every[k] for k in sorted(chosen)]


def load_libraries() -> None:
    """Load what the tests need besides the package, once for all forks."""
    import hypothesis
    import mpmath
    import pinocchio
    import scipy.optimize
    import scipy.sparse.linalg
    import scipy.spatial.transform
    import scipy.stats

    del hypothesis, mpmath, pinocchio, scipy


def verdicts(mutants: Sequence[Mutant], longest_s: float) -> Iterator[Verdict]:
    """Judge mutants one after another; rooms that take too long without any mutant are judged by own tests alone."""
    with TemporaryDirectory() as folder:
        sources = Path(folder) / "src"
        shutil.copytree(SOURCE.parent, sources, ignore=shutil.ignore_patterns("__pycache__"))
        usual: dict[tuple[Path, ...], float] = {}
        for mutant in mutants:
            tests = room_tests(mutant.file)
            if not tests:
                yield Verdict(mutant, "survived")
                continue
            key = tuple(sorted(tests))
            if key not in usual:
                began = time.monotonic()
                unharmed = judged(sources, tests, longest_s)
                if unharmed != "survived":
                    raise SystemExit(f"the tests of {tests[0].parent} end as {unharmed} without any mutant")
                usual[key] = time.monotonic() - began
            path = sources / "basecal" / mutant.file
            unchanged = path.read_text(encoding="utf-8")
            path.write_text(mutant.source, encoding="utf-8")
            yield Verdict(mutant, judged(sources, tests, 10 + SLOWER * usual[key]))
            path.write_text(unchanged, encoding="utf-8")


def run_of(packages: Sequence[str], seed: int, found: Sequence[Verdict]) -> dict[str, Any]:
    """A run as it is kept: how many mutants each room had, how many were killed, and the others."""
    rooms = [str(Path(each.mutant.file).parent) for each in found]
    killed = [room for room, each in zip(rooms, found, strict=True) if each.end != "survived"]
    left = [each.mutant for each in found if each.end == "survived"]
    return {
        "packages": list(packages),
        "seed": seed,
        "commit": commit(),
        "mutants": dict(sorted(Counter(rooms).items())),
        "killed": dict(sorted(Counter(killed).items())),
        "survived": [{"file": of.file, "line": of.line, "old": of.old, "new": of.new} for of in left],
    }


def rows(runs: Sequence[dict[str, Any]]) -> list[tuple[str, int, int, int, str]]:
    """Rows of the table with `HEAD`, one a package and one for all."""
    counts: dict[str, list[int]] = {}
    for run in runs:
        for room, mutants in run["mutants"].items():
            alike = sum(each["file"].rpartition("/")[0] == room and is_equivalent(each) for each in run["survived"])
            for name in (room.split("/")[0], "all"):
                so_far = counts.setdefault(name, [0, 0, 0])
                counts[name] = [
                    n + m for n, m in zip(so_far, (mutants, run["killed"].get(room, 0), alike), strict=True)
                ]
    names = sorted(counts, key=lambda name: (name == "all", name))
    return [
        (name, *counts[name], f"{100 * counts[name][1] / max(counts[name][0] - counts[name][2], 1):.0f} %")
        for name in names
    ]


def is_equivalent(survivor: dict[str, Any]) -> bool:
    """Whether nothing that a test could see differs."""
    return reason(survivor).startswith("equivalent")


def survivors(runs: Sequence[dict[str, Any]]) -> list[tuple[str, str, str, str]]:
    """Rows of the table with `HEAD_OF_SURVIVORS`."""
    left = [each for run in runs for each in run["survived"]]
    told = [(f"{e['file']}:{e['line']}", f"`{e['old']}`", f"`{e['new']}`", reason(e)) for e in left]
    return [(place, old.replace("|", "\\|"), new.replace("|", "\\|"), why) for place, old, new, why in told]


def kept_runs() -> list[dict[str, Any]]:
    """The last run of each choice of packages."""
    path = RESULTS / "mutants.json"
    runs: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["runs"] if path.exists() else []
    return runs


def keep(run: dict[str, Any]) -> None:
    """Put a run in place of the last one of the same packages."""
    others = [r for r in kept_runs() if r["packages"] != run["packages"]]
    write("mutants", {"runs": sorted([*others, run], key=lambda r: str(r["packages"]))})


def _place(mutant: dict[str, Any]) -> tuple[Any, ...]:
    return mutant["file"], mutant["line"], mutant["old"], mutant["new"]


def judged_again(run: dict[str, Any]) -> dict[str, Any]:
    """A run with what survived judged by the tests as they are now; what is no longer in the sources stays."""
    wanted = {_place(each) for each in run["survived"]}
    there = [m for file in sorted({w[0] for w in wanted}) for m in mutants_of(SOURCE / file)]
    verdict_of: dict[tuple[Any, ...], set[str]] = {}
    for each in verdicts([m for m in there if _place(m._asdict()) in wanted], LONGEST_S):
        verdict_of.setdefault(_place(each.mutant._asdict()), set()).add(each.end)
    left = [each for each in run["survived"] if "survived" in verdict_of.get(_place(each), {"survived"})]
    gone = Counter(str(Path(e["file"]).parent) for e in run["survived"] if e not in left)
    killed = Counter(run["killed"]) + gone
    return {**run, "commit": commit(), "killed": dict(sorted(killed.items())), "survived": left}


def main(arguments: list[str]) -> None:
    """Sample, judge, print, and keep."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutants", description=__doc__)
    parser.add_argument("--packages", nargs="*", default=list(PACKAGES), metavar="PACKAGE", help="such as cell/journal")
    parser.add_argument("--count", type=int, default=400)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--again", action="store_true", help="judge anew what survived in the runs that are kept")
    asked = parser.parse_args(arguments)
    os.nice(NICE)
    os.chdir(ROOT)
    load_libraries()
    if asked.again:
        for run in kept_runs():
            keep(judged_again(run))
        print(table(HEAD, rows(kept_runs())))
        return
    found = []
    for verdict in verdicts(sample_of(asked.packages, asked.count, asked.seed), LONGEST_S):
        found.append(verdict)
        if verdict.end == "survived":
            of = verdict.mutant
            print(f"survived: {of.file}:{of.line}: {of.old}  ->  {of.new}", flush=True)
    run = run_of(asked.packages, asked.seed, found)
    print(table(HEAD, rows([run])))
    keep(run)


if __name__ == "__main__":
    main(sys.argv[1:])
