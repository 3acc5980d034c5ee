"""Tests of the language of findings: short sentences that state the problem and the advice."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tests.source_trees import nodes_of, parsed

SOURCE = Path(__file__).parents[1] / "src" / "basecal"
FILES = sorted(SOURCE.rglob("*.py"))


def findings_made() -> list[tuple[Path, ast.Call]]:
    """Calls that create a finding, except in readers of stored findings."""
    return [
        (path, node)
        for path in FILES
        for node in nodes_of(parsed(path))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Finding"
    ]


def test_every_warning_and_error_has_advice() -> None:
    """A finding with a literal severity has advice as its fifth argument."""
    silent = [
        f"{path.relative_to(SOURCE)}:{node.lineno}"
        for path, node in findings_made()
        if len(node.args) > 1
        and isinstance(node.args[1], ast.Constant)
        and node.args[1].value in ("warning", "error")
        and len(node.args) < 5
        and not any(isinstance(arg, ast.Starred) for arg in node.args)
    ]
    assert silent == []


def literal_length(text: ast.expr) -> int:
    """Number of words of a text; each inserted value counts as one."""
    if isinstance(text, ast.Constant) and isinstance(text.value, str):
        return len(text.value.split())
    if isinstance(text, ast.JoinedStr):
        return len("".join(v.value if isinstance(v, ast.Constant) else "x" for v in text.values).split())
    return 0


@pytest.mark.parametrize("name", ["what", "why"])
def test_sentences_are_short(name: str) -> None:
    """Sentences have at most 20 words; each inserted value counts as one."""
    long = [
        f"{path.relative_to(SOURCE)}:{node.lineno}"
        for path in {path for path, _ in findings_made()}
        for node in nodes_of(parsed(path))
        if isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Name)
        and node.targets[0].id == name
        and literal_length(node.value) > 20
    ]
    assert long == []
