"""Tests of the registries: a new named kind needs one module and one table row, and no other comparison of names."""

from __future__ import annotations

import ast
from collections.abc import Collection
from pathlib import Path
from typing import get_args

import pytest

from basecal.acquisition.drivers.registry import DRIVERS
from basecal.cell.targets.registry import TARGETS, TargetKindName
from basecal.effects.registry import EFFECTS
from basecal.exchange.exporters.pendants import PENDANTS
from basecal.exchange.exporters.registry import EXPORTERS
from basecal.geometry.lenses.registry import LENSES
from basecal.planning.patterns import PATTERNS
from basecal.studies.solvers.registry import SOLVERS
from tests.source_trees import nodes_of, parsed

SOURCE = Path(__file__).parents[1] / "src" / "basecal"
NAMES = {*TARGETS, *LENSES}


def asked_for(tree: ast.AST) -> list[str]:
    """Lines that compare or match a registered name, or have a table of at least two such names."""
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
BY_THEMSELVES = {
    "vision/detectors.py",
    "cell/targets/registry.py",
    "geometry/lenses/registry.py",
    *(f"cell/targets/{name}.py" for name in TARGETS),
}


def test_no_module_compares_kinds_or_lenses() -> None:
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
def test_comparison_check_finds_violations(source: str) -> None:
    """Comparisons, memberships, tables and matches are found."""
    assert asked_for(ast.parse(source))


@pytest.mark.parametrize(
    ("folder", "face", "table"),
    [
        ("cell/targets", "KIND = ", TARGETS),
        ("geometry/lenses", "MODEL = ", LENSES),
        ("exchange/exporters", "EXPORTER = ", EXPORTERS.keys() - PENDANTS.keys()),
        ("acquisition/drivers", "def open_", DRIVERS),
        ("planning", "def plan(", PATTERNS),
        ("studies/solvers", "SOLVER = ", SOLVERS),
        ("effects", "EFFECT = ", EFFECTS),
    ],
)
def test_every_module_is_registered(folder: str, face: str, table: Collection[str]) -> None:
    """Each name has its module, and each module with the interface of a kind is registered."""
    faces = {path.stem for path in (SOURCE / folder).glob("*.py") if f"\n{face}" in path.read_text(encoding="utf-8")}
    named = {name.replace("-", "_") for name in table}
    assert not faces - named, f"name in src/basecal/{folder}, in the table of its kind: {sorted(faces - named)}"
    assert not named - faces, f"the table of {folder} names what no module of that name holds: {sorted(named - faces)}"


def test_target_names_equal_the_table() -> None:
    """The type of target names lists the names of the table in order."""
    assert get_args(TargetKindName) == tuple(TARGETS)
