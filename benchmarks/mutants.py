"""How many small faults in the sources the tests of their own room find.

A mutant is one source file with one expression changed (`benchmarks/small_faults.py`). Its room is the folder of the
tests that mirrors the folder of the file; only these tests judge it. The sample is drawn with a seed; a mutant that a
test fails on, or that makes the tests hang (by processor time), is killed. `benchmarks/results/mutants.json` keeps the
last run of each choice of packages and seed, and what survived. Who looks at a survivor writes there `why` it did: it
begins with `equivalent` if nothing tells it from the original. A later run takes over the reasons of the same mutants.

Every mutant is judged in a fork of one process that has the libraries loaded but nothing of the package, with a copy
of the sources in which that file is changed: nothing of the work tree is touched. Tests that never enter the function
that is changed cannot fail because of it, so that only those that do are run (`benchmarks/entered.py`): those under the
file's own name first, quick ones before slow ones, until one fails. Hypothesis draws the same examples every time.
With `--keep FOLDER` verdicts and what tests enter are kept there, and a run that was stopped goes on. `--elsewhere`
judges what survived its own room by the tests of all other folders, the quick ones first, for at most so many seconds
of the processor. Deadlines and trials of safety do not judge there: a busy machine may miss them.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import resource
import shutil
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import accumulate
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, NamedTuple, NoReturn

import pytest

from benchmarks.common import RESULTS, Kept, commit, table, write
from benchmarks.entered import Chosen, FileOfTests, Judge, Tracer, keep_found, kept_found, telling
from benchmarks.small_faults import ROOT, SOURCE, Mutant, mutants_of, sample_of

TESTS = ROOT / "tests"
PACKAGES = ("geometry", "numerics", "kinematics", "cell", "estimation", "accuracy")
SLOWER = 5.0  # tests that compute so many times as long as without a mutant are taken to hang
SPARE_S = 20.0  # to load and collect
WAITS = 20.0  # so many times as long by the clock: they wait for what never comes
HEAD = ("package", "mutants", "equivalent", "killed", "of the others", "by all tests", "of the others",
        "with the tests added", "of the others")  # fmt: skip
HEAD_OF_SURVIVORS = ("survived", "was", "became", "why")
UNKNOWN = "no test of its folder distinguishes the two so far"
CHANGE = ("file", "text", "old", "new")
NICE = 10
# Marks of the tests that judge.
IN_ROOM = "not slow"
ELSEWHERE = "not slow and not timed"


class Verdict(NamedTuple):
    """What became of a mutant: `killed`, `hung` or `survived`."""

    mutant: Mutant
    end: str


def room_tests(file: str) -> list[Path]:
    """The tests of a file's room: those under its own name first."""
    folder = TESTS / Path(file).parent
    own = folder / f"test_{Path(file).name}"
    return sorted(folder.glob("test_*.py"), key=lambda path: (path != own, path.name))


def judged(sources: Path, names: Sequence[str], seconds: float, marks: str) -> str:
    """Run tests by name on a copy of the sources in a fork: `survived` where all pass, `killed` or `hung`.

    They may compute `seconds` [s]. Only tests of these marks run.
    """
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds) + 1, int(seconds) + 10))
        files = dict.fromkeys(name.partition("::")[0] for name in names)
        sys.path.insert(0, str(sources))
        _leave(lambda: _run(sources, [*files], Chosen(list(names)), marks))
    end = time.monotonic() + WAITS * seconds
    while time.monotonic() < end:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            code = os.waitstatus_to_exitcode(status)
            if code == pytest.ExitCode.NO_TESTS_COLLECTED:
                raise SystemExit(f"none of the tests was found: {names[0]}")
            return "survived" if code == 0 else "hung" if code in {-signal.SIGXCPU, -signal.SIGKILL} else "killed"
        time.sleep(0.02)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return "hung"


def measured(sources: Path, tells: Path, tests: Path, kept: Path, marks: str) -> FileOfTests:
    """What the tests of a file enter, by sources that tell it; kept in a file. Processes of tests tell nothing."""
    if not kept.exists():
        child = os.fork()
        if child == 0:
            sys.path.insert(0, str(tells))
            _leave(lambda: _trace(sources, tells, tests, kept, marks))
        _, status = os.waitpid(child, 0)
        if os.waitstatus_to_exitcode(status):
            raise SystemExit(f"{tests} fails without any mutant")
    return kept_found(kept)


def _trace(sources: Path, tells: Path, tests: Path, kept: Path, marks: str) -> int:
    """Keep what the tests of a file enter; return 0 if they pass."""
    tracer = Tracer(tells / "basecal")
    ended = _run(sources, [str(tests)], tracer, marks)
    if ended not in {pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED}:
        return ended
    keep_found(tracer.found(), kept)
    return 0


def _leave(act: Callable[[], int]) -> NoReturn:
    """End this fork with an exit code, whatever is raised: a test may fork in turn, and its fork must end here, too."""
    code = 1
    try:
        code = act()
    finally:
        os._exit(code)


def _run(sources: Path, tests: Sequence[str], plugin: Any, marks: str) -> int:
    """Run tests of some marks without a word; processes that they start have these sources."""
    silence = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(silence, stream)
    os.environ["PYTHONPATH"] = str(sources)
    without = [part for name in ("cacheprovider", "xdist", "benchmark") for part in ("-p", f"no:{name}")]
    quiet = ["-x", "-q", "--assert=plain", "-m", marks, *without, "--rootdir", str(ROOT)]
    return int(pytest.main([*quiet, *tests], plugins=[plugin]))


def load_libraries() -> None:
    """Load what the tests need besides the package, once for all forks."""
    import hypothesis
    import mpmath
    import pinocchio
    import pydantic
    import ruamel.yaml
    import scipy.optimize
    import scipy.sparse.linalg
    import scipy.spatial.transform
    import scipy.stats

    hypothesis.settings.register_profile("mutants", derandomize=True, database=None)
    hypothesis.settings.load_profile("mutants")
    pydantic.create_model("AnyModel", number=(int, 3))  # loads what it puts off
    ruamel.yaml.YAML(typ="safe", pure=True)
    del mpmath, pinocchio, scipy


class Court:
    """Judges mutants on a copy of the sources; a context, for as long as the copy is there.

    What tests enter is kept in a folder, by all that it depends on.
    """

    def __init__(self, kept: Path | None = None) -> None:
        self._folder = Path(mkdtemp())  # without the finalizer of a context: a test's own fork would run it
        self._sources = self._folder / "src"
        self._telling = self._folder / "telling"
        self._kept = self._folder / "entered" if kept is None else kept / "entered"
        self._about = b""
        self._files: dict[tuple[Path, str], FileOfTests] = {}

    def __enter__(self) -> Court:
        shutil.copytree(SOURCE.parent, self._sources, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copytree(self._sources, self._telling)
        self._kept.mkdir(parents=True, exist_ok=True)
        for path in sorted((self._telling / "basecal").rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            self._about += text.encode()
            path.write_text(telling(text, str(path.relative_to(self._telling / "basecal"))), encoding="utf-8")
        for path in sorted((*TESTS.glob("*.py"), *(TESTS / "shared").glob("*.py"))):
            self._about += path.read_bytes()
        return self

    def __exit__(self, *error: object) -> None:
        shutil.rmtree(self._folder)

    def verdict(self, mutant: Mutant) -> str:
        """How a mutant ends: the tests under its own name first, the others of its room if it survives these."""
        tests = room_tests(mutant.file)
        own = [path for path in tests if path.name == f"test_{Path(mutant.file).name}"]
        for paths in (own, tests[len(own) :]):
            chosen = self._judges(mutant, paths, IN_ROOM)
            chosen.sort(key=lambda test: (not test.enters_file(mutant.file), test.seconds))
            if (end := self._judged(mutant, chosen, IN_ROOM)) != "survived":
                return end
        return "survived"

    def verdict_elsewhere(self, mutant: Mutant, most_s: float) -> str:
        """How a mutant ends by the tests of all other folders that compute at most `most_s` [s], the quick ones first.

        Tests that start a process may enter anything; they come last.
        """
        own = set(room_tests(mutant.file))
        others = [path for path in sorted(TESTS.rglob("test_*.py")) if path not in own]
        chosen = self._judges(mutant, others, ELSEWHERE)
        chosen.sort(key=lambda test: (test.entered is None, test.seconds))
        within = accumulate(test.seconds for test in chosen)
        quick = [test for test, so_far in zip(chosen, within, strict=True) if so_far <= most_s]
        return self._judged(mutant, quick, ELSEWHERE)

    def _judges(self, mutant: Mutant, paths: Sequence[Path], marks: str) -> list[Judge]:
        return [test for path in paths for test in self._entered(path, marks).judges(mutant.file, mutant.function)]

    def _entered(self, tests: Path, marks: str) -> FileOfTests:
        if (tests, marks) not in self._files:
            key = hashlib.sha256(self._about + tests.read_bytes() + marks.encode()).hexdigest()[:16]
            kept = self._kept / f"{tests.stem}_{key}"
            try:
                self._files[tests, marks] = measured(self._sources, self._telling, tests, kept, marks)
            except SystemExit as error:
                if marks == IN_ROOM:
                    raise
                print(f"judges nothing elsewhere: {error}", file=sys.stderr, flush=True)
                self._files[tests, marks] = FileOfTests((), frozenset())
        return self._files[tests, marks]

    def _judged(self, mutant: Mutant, tests: Sequence[Judge], marks: str) -> str:
        if not tests:
            return "survived"
        path = self._sources / "basecal" / mutant.file
        unchanged = path.read_text(encoding="utf-8")
        try:
            self._write_source(path, mutant.source)
            allowed = SPARE_S + SLOWER * sum(test.seconds for test in tests)
            return judged(self._sources, [test.name for test in tests], allowed, marks)
        finally:
            self._write_source(path, unchanged)

    def _write_source(self, path: Path, text: str) -> None:
        """Write a source; what was compiled of one as long, written in the same second, must not be taken for it."""
        path.write_text(text, encoding="utf-8")
        for compiled in path.parent.glob(f"__pycache__/{path.stem}.*"):
            compiled.unlink()


def run_of(packages: Sequence[str], seed: int, found: Sequence[Verdict]) -> dict[str, Any]:
    """A run as it is kept: how many mutants each package had, and those that survived."""
    left = [each.mutant for each in found if each.end == "survived"]
    names, known = ("file", "line", "text", "old", "new", "nth"), reasons()
    survived = [{**{name: getattr(of, name) for name in names}, "now": "survived"} for of in left]
    return {
        "packages": list(packages),
        "seed": seed,
        "commit": commit(),
        "mutants": dict(sorted(Counter(each.mutant.file.split("/")[0] for each in found).items())),
        "survived": [{**each, **known.get(tuple(each[name] for name in CHANGE), {})} for each in survived],
    }


def _ends_elsewhere(survivor: dict[str, Any]) -> bool:
    return survivor.get("elsewhere") == "killed"


def _ends(survivor: dict[str, Any]) -> bool:
    """Whether the tests as they are now, of any folder, kill what its own room missed."""
    return survivor["now"] == "killed" or _ends_elsewhere(survivor)


def _share(count: int, of_all: int) -> str:
    return f"{100 * count / max(of_all, 1):.1f} %"


def rows(run: dict[str, Any]) -> list[tuple[Any, ...]]:
    """Rows of the table with `HEAD`, one a package and one for all."""
    found = []
    for package, mutants in (*run["mutants"].items(), ("", sum(run["mutants"].values()))):
        left = [each for each in run["survived"] if each["file"].startswith(package)]
        alike = sum(each.get("why", "").startswith("equivalent") for each in left)
        killed = mutants - len(left)
        count = mutants - alike
        by_all = killed + sum(map(_ends_elsewhere, left))
        every = (by_all, _share(by_all, count)) if any("elsewhere" in each for each in run["survived"]) else ("", "")
        now = killed + sum(map(_ends, left))
        found.append((package or "all", mutants, alike, killed, _share(killed, count), *every, now, _share(now, count)))
    return found


def survivors(runs: Sequence[dict[str, Any]]) -> list[tuple[str, str, str, str]]:
    """Rows of the table with `HEAD_OF_SURVIVORS`."""
    left = [each for run in runs for each in run["survived"] if not _ends(each)]
    told = [(f"{e['file']}:{e['line']}", f"`{e['old']}`", f"`{e['new']}`", e.get("why", UNKNOWN)) for e in left]
    return [(place, old.replace("|", "\\|"), new.replace("|", "\\|"), why) for place, old, new, why in told]


def kept_runs() -> list[dict[str, Any]]:
    """The last run of each choice of packages and seed."""
    path = RESULTS / "mutants.json"
    runs: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["runs"] if path.exists() else []
    return runs


def reasons() -> dict[tuple[str, ...], dict[str, str]]:
    """Why mutants survived, as it is written in the runs that are kept, by what was changed."""
    survived = [each for run in kept_runs() for each in run["survived"] if "why" in each]
    return {tuple(each[name] for name in CHANGE): {"why": each["why"]} for each in survived}


def keep(run: dict[str, Any]) -> None:
    """Put a run in place of the last one of the same packages and seed."""
    others = [r for r in kept_runs() if (r["packages"], r["seed"]) != (run["packages"], run["seed"])]
    write("mutants", {"runs": sorted([*others, run], key=lambda r: (str(r["packages"]), r["seed"]))})


def judged_again(run: dict[str, Any], court: Court) -> dict[str, Any]:
    """A run with what survived judged by the tests as they are now; what is no longer in the sources stays."""
    now = []
    for each in run["survived"]:
        mutant = _mutant_of(each)
        ended = court.verdict(mutant) if mutant else each["now"]
        now.append({**each, "now": "survived" if ended == "survived" else "killed"})
    return {**run, "again": commit(), "survived": now}


def _mutant_of(survivor: dict[str, Any]) -> Mutant | None:
    """The mutant that a run keeps, in the sources as they are; None where they no longer hold it."""
    place = tuple(survivor[name] for name in Mutant._fields[:6] if name != "line")
    return next((each for each in mutants_of(SOURCE / survivor["file"]) if each.place == place), None)


def judged_elsewhere(run: dict[str, Any], court: Court, most_s: float) -> dict[str, Any]:
    """A run with what survived its own room judged by the tests of all other folders."""
    found = []
    for each in run["survived"]:
        mutant = None if each.get("why", "").startswith("equivalent") else _mutant_of(each)
        if mutant is not None:
            ended = court.verdict_elsewhere(mutant, most_s)
            each = {**each, "elsewhere": "survived" if ended == "survived" else "killed"}
            print(
                f"{each['elsewhere']} elsewhere: {mutant.file}:{mutant.line}: {mutant.old}  ->  {mutant.new}",
                flush=True,
            )
        found.append(each)
    return {**run, "survived": found}


def judged_once(packages: Sequence[str], count: int, seed: int, court: Court, path: Path | None) -> dict[str, Any]:
    """A new run, each verdict taken from a file or kept there."""
    kept, found = Kept(path / f"verdicts_{seed}.jsonl" if path else None), []
    for mutant in sample_of(packages, count, seed):
        found.append(Verdict(mutant, kept.of(json.dumps(mutant.place), lambda mutant=mutant: court.verdict(mutant))))
        if found[-1].end == "survived":
            print(f"survived: {mutant.file}:{mutant.line}: {mutant.old}  ->  {mutant.new}", flush=True)
    return run_of(packages, seed, found)


def main(arguments: list[str]) -> None:
    """Sample, judge, print, and keep."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutants", description=__doc__)
    parser.add_argument("--packages", nargs="*", default=list(PACKAGES), metavar="PACKAGE", help="such as cell/journal")
    parser.add_argument("--count", type=int, default=400)
    parser.add_argument("--seed", type=int, help="of the draw, 0 by default; of the kept runs to judge, all by default")
    parser.add_argument("--keep", type=Path, help="folder in which verdicts are kept, and from which a run goes on")
    parser.add_argument("--again", action="store_true", help="judge anew what survived in the kept runs")
    elsewhere = "judge what survived in the kept runs by the tests of all other folders, for SECONDS each"
    parser.add_argument("--elsewhere", type=float, metavar="SECONDS", help=elsewhere)
    asked = parser.parse_args(arguments)
    os.nice(NICE)
    os.chdir(ROOT)
    load_libraries()
    with Court(asked.keep) as court:
        kept = [run for run in kept_runs() if asked.seed in {None, run["seed"]}]
        if asked.elsewhere:
            runs = [judged_elsewhere(run, court, asked.elsewhere) for run in kept]
        elif asked.again:
            runs = [judged_again(run, court) for run in kept]
        else:
            runs = [judged_once(asked.packages, asked.count, asked.seed or 0, court, asked.keep)]
    for run in runs:
        print(table(HEAD, rows(run)))
        keep(run)


if __name__ == "__main__":
    main(sys.argv[1:])
