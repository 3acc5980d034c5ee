"""What can be chosen by name is asked for nowhere else: a new one is one module and one line."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import get_args

import pytest

from basecal.registry import (
    CONTROLLERS,
    DRIVERS,
    EXPORTERS,
    LENSES,
    MOTIONS,
    PATTERNS,
    SOLVERS,
    TargetKindName,
)
from source_trees import nodes_of, parsed

SOURCE = Path(__file__).parents[1] / "src" / "basecal"
NAMES = {*get_args(TargetKindName), *LENSES}


def asked_for(tree: ast.AST) -> list[str]:
    """Lines that compare something with a registered name, match it, or have a table of two such names and more."""
    found = []
    for node in nodes_of(tree):
        if isinstance(node, ast.Compare):
            parts = [node.left, *node.comparators]
        elif isinstance(node, ast.MatchValue):
            parts = [node.value]
        elif isinstance(node, ast.Dict):
            parts = [key for key in node.keys if key is not None]
        else:
            continue
        constants = [each for part in parts for each in ast.walk(part) if isinstance(each, ast.Constant)]
        named = [f"line {each.lineno}: {each.value!r}" for each in constants if each.value in NAMES]
        found += named if len(named) > isinstance(node, ast.Dict) else []
    return found


# Ways of finding have names of their own, some of which are those of the kinds that began with them; a kind's module
# may say its fields and figures.
BY_THEMSELVES = {"vision/detectors.py", *(f"cell/targets/{name}.py" for name in get_args(TargetKindName))}


def test_nothing_asks_what_kind_or_lens() -> None:
    """No module compares with the name of a target kind or a lens, or has a table of them."""
    faults = {}
    for path in sorted(SOURCE.rglob("*.py")):
        name = path.relative_to(SOURCE).as_posix()
        if name not in BY_THEMSELVES and (lines := asked_for(parsed(path))):
            faults[name] = lines
    assert faults == {}


@pytest.mark.parametrize(
    "source",
    [
        "if target.kind == 'led': pass",
        "x = kind in ('points', 'led')",
        "x = {'pinhole': 5, 'fisheye': 4}[model]",
        "match kind:\n    case 'charuco': pass",
    ],
)
def test_the_check_bites(source: str) -> None:
    """Comparisons, memberships, tables and matches are found."""
    assert asked_for(ast.parse(source))


@pytest.mark.parametrize(
    ("folder", "names"),
    [
        ("cell/targets", get_args(TargetKindName)),
        ("geometry/lenses", LENSES),
        ("exchange/exporters", tuple(EXPORTERS)),
        ("exchange/controllers", CONTROLLERS),
        ("exchange/motions", tuple(name.replace("-", "_") for name in MOTIONS)),
        ("acquisition/drivers", DRIVERS),
        ("planning", tuple(PATTERNS)),
        ("studies/solvers", tuple(SOLVERS)),
    ],
)
def test_every_module_is_registered(folder: str, names: tuple[str, ...]) -> None:
    """Each name has its module, and no module that has the face of one is left out."""
    face = {
        "cell/targets": "KIND = ",
        "geometry/lenses": "MODEL = ",
        "exchange/exporters": "def exported(wanted",
        "exchange/controllers": "CONVENTION = ",
        "exchange/motions": "def written(way",
        "acquisition/drivers": "def open_",
        "planning": "def plan(",
        "studies/solvers": "BLOCKS = ",
    }[folder]
    faces = {path.stem for path in (SOURCE / folder).glob("*.py") if f"\n{face}" in path.read_text(encoding="utf-8")}
    assert faces == set(names)
