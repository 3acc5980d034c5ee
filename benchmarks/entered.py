"""Which functions of the package each test of a file enters, and how long it takes.

A test that enters neither a function nor anything within it cannot fail because of a change there: a mutant need not be
judged by it. Measured once a room, without any mutant, by a trace of calls. What a cache or a fixture of wider scope
computes for one test counts for every test that may use it: caches are emptied before each test, and what a fixture
entered counts for all its users. What runs as modules are imported or tests collected, and what stands outside
functions, counts for all tests of the file; a test that starts a process counts as entering everything. Were
something overlooked, a mutant would seem to survive: the share killed is never flattered.
"""

from __future__ import annotations

import ast
import builtins
import os
import pickle
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

Place = tuple[str, int]  # file below the package, first line of a function
TELL = "_entered_"  # the function that functions call as they are entered
IMPORT = "_importing_"  # and modules, as they begin and end to be imported
SILENT = f"""
import builtins
for name in ({TELL!r}, {IMPORT!r}):
    builtins.__dict__.setdefault(name, lambda *told: None)
del builtins, name
"""  # at the head of the package: a process that a test starts by these sources has nobody to tell
PROCESSES = {"subprocess.Popen", "os.fork", "os.posix_spawn", "os.exec", "os.system"}


class Judge(NamedTuple):
    """A test that passes: its name, the functions it enters (None: any), the time it and its processes compute [s]."""

    name: str
    entered: frozenset[Place] | None
    seconds: float

    def enters(self, file: str, lines: range) -> bool:
        """Whether it enters a function that begins on one of these lines."""
        return self.entered is None or any(of == file and line in lines for of, line in self.entered)

    def enters_file(self, file: str) -> bool:
        """Whether it enters any function of a file."""
        return self.enters(file, range(sys.maxsize))


class FileOfTests(NamedTuple):
    """The tests of a file, and the functions that run before any of them."""

    tests: tuple[Judge, ...]
    before: frozenset[Place]

    def judges(self, file: str, lines: range) -> list[Judge]:
        """The tests that a change of these lines may make fail; without lines, all."""
        early = any(of == file and line in lines for of, line in self.before)
        return [test for test in self.tests if early or not lines or test.enters(file, lines)]


def first_line(function: ast.FunctionDef) -> int:
    """The line of a function, or of its first decorator."""
    return min([function.lineno, *(each.lineno for each in function.decorator_list)])


def telling(text: str, file: str) -> str:
    """A source in which every function begins by telling its place, and the module when it is imported."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            after = 1 if ast.get_docstring(node, clean=False) is not None else 0
            node.body.insert(after, ast.parse(f"{TELL}({file!r}, {first_line(node)})").body[0])
    is_head = [isinstance(node, ast.ImportFrom) and node.module == "__future__" for node in tree.body]
    start = 1 + is_head.index(True) if any(is_head) else int(ast.get_docstring(tree) is not None)
    tree.body.insert(start, ast.parse(f"{IMPORT}(1)").body[0])
    tree.body.append(ast.parse(f"{IMPORT}(-1)").body[0])
    if file == "__init__.py":
        tree.body[start:start] = ast.parse(SILENT).body
    return ast.unparse(tree)


class Tracer:
    """A plugin of pytest that notes which functions tests enter."""

    def __init__(self, package: Path) -> None:
        self._package = package
        self._now: set[Place] = set()
        self._outside = False
        self._before_tests: set[Place] = set()
        self._of_fixture: dict[int, set[Place]] = {}
        self._tests: list[Judge] = []
        sys.addaudithook(self._audit)
        setattr(builtins, TELL, self._enter)
        setattr(builtins, IMPORT, self._import)
        self._importing = 0

    def found(self) -> FileOfTests:
        """What was found."""
        return FileOfTests(tuple(self._tests), frozenset(self._before_tests))

    @pytest.hookimpl(wrapper=True)
    def pytest_make_collect_report(self) -> Iterator[None]:
        """What runs while tests are collected counts for all."""
        self._now = set()
        result = yield
        self._before_tests |= self._now
        return result

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Iterator[None]:
        """What a fixture enters counts for all tests that use it."""
        outer, self._now = self._now, set()
        try:
            return (yield)
        finally:
            self._of_fixture.setdefault(id(fixturedef), set()).update(self._now)
            self._now |= outer

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: Any) -> Iterator[None]:
        """One test."""
        self._empty_caches()
        self._now, self._outside = set(), False
        began = _computed_s()
        result = yield
        took = _computed_s() - began
        for definitions in item._fixtureinfo.name2fixturedefs.values():
            self._now.update(*(self._of_fixture.get(id(each), ()) for each in definitions))
        self._tests.append(Judge(item.nodeid, None if self._outside else frozenset(self._now), took))
        return result

    def _enter(self, file: str, line: int) -> None:
        (self._before_tests if self._importing else self._now).add((file, line))

    def _import(self, step: int) -> None:
        self._importing += step

    def _audit(self, event: str, arguments: Any) -> None:
        self._outside = self._outside or event in PROCESSES

    def _empty_caches(self) -> None:
        for module in list(sys.modules.values()):
            if (getattr(module, "__file__", None) or "").startswith((str(self._package), str(Path.cwd() / "tests"))):
                for thing in list(vars(module).values()):
                    if hasattr(thing, "cache_clear") and not isinstance(thing, type):
                        thing.cache_clear()


def _computed_s() -> float:
    """Time that this process and those that it has waited for have computed [s]."""
    return sum(os.times()[:4])


class Chosen:
    """A plugin of pytest that runs the tests of these names alone, in this order."""

    def __init__(self, names: list[str]) -> None:
        self._place = {name: place for place, name in enumerate(names)}

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        """Leave out the others, and put these in order."""
        items[:] = sorted((i for i in items if i.nodeid in self._place), key=lambda i: self._place[i.nodeid])


def keep_found(found: FileOfTests, path: Path) -> None:
    """Write what was found in a process for the one that started it."""
    path.write_bytes(pickle.dumps(found))


def kept_found(path: Path) -> FileOfTests:
    """What a process that was started has found."""
    found: FileOfTests = pickle.loads(path.read_bytes())
    return found
