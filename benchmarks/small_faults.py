"""Small faults in the sources: one expression of one file changed.

A comparison is reversed or its border shifted, an operator exchanged, a condition negated, or a number changed.
"""

from __future__ import annotations

import ast
import copy
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.entered import first_line

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "basecal"

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
    """One change: the file below `src/basecal`, the old and the new expression, and the new source.

    `text` is the changed line, and `nth` counts equal changes of a file. `function` holds the lines of the innermost
    function whose body is changed. It is empty if the module itself runs the expression.
    """

    file: str
    line: int
    text: str
    old: str
    new: str
    nth: int
    function: range
    source: str

    @property
    def place(self) -> tuple[str, str, str, str, int]:
        """Identity of the mutant, which does not depend on the number of its line."""
        return self.file, self.text, self.old, self.new, self.nth


def replacements(node: ast.AST) -> Iterator[ast.AST]:
    """All replacements of a node."""
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
    """Whether an expression is a count by its form: borders between real numbers make no difference."""
    match node:
        case ast.Constant(value=int()) | ast.Call(func=ast.Name(id="len")):
            return True
    return False


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _places(tree: ast.AST) -> Iterator[tuple[ast.AST, str, int | None]]:
    """Every expression by its parent, field and index, without annotations, decorators and messages of errors."""
    for field, value in ast.iter_fields(tree):
        if field in {"annotation", "returns", "decorator_list", "type_params"} or isinstance(tree, ast.Raise):
            continue
        for place, child in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if isinstance(child, ast.AST) and not _is_declaration(child):
                yield tree, field, place
                yield from _places(child)


def _is_declaration(node: ast.AST) -> bool:
    """Whether a node is for type checkers alone, is text, or asserts what is true by construction."""
    match node:
        case ast.If(test=ast.Name(id="TYPE_CHECKING")) | ast.JoinedStr() | ast.keyword(arg="strict"):
            return True
        case ast.Assign(targets=[ast.Name(id=name)], value=ast.Subscript(value=ast.Name(id=kind))):
            return name[:1].isupper() and kind in {"Literal", "Callable", "Mapping", "NDArray", "tuple", "dict"}
    return False


def mutants_of(path: Path, wanted: Collection[int] | None = None) -> Iterator[Mutant]:
    """Every mutant of a file in the order of its text, or those with these numbers."""
    text = path.read_text(encoding="utf-8")
    lines, tree = text.splitlines(), ast.parse(text)
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    alike: Counter[tuple[str, str, str]] = Counter()
    for k, (parent, field, place, other) in enumerate(_changes(tree)):
        holder = getattr(parent, field)
        node = holder if place is None else holder[place]
        what = lines[node.lineno - 1].strip(), ast.unparse(node), ast.unparse(other)
        alike[what] += 1
        if wanted is not None and k not in wanted:
            continue
        new = ast.copy_location(copy.deepcopy(other), node)
        _set_node(parent, field, place, new)
        source = ast.unparse(ast.fix_missing_locations(tree))
        _set_node(parent, field, place, node)
        file = str(path.relative_to(SOURCE))
        yield Mutant(file, node.lineno, *what, alike[what] - 1, _function_lines(functions, node), source)


def _changes(tree: ast.AST) -> Iterator[tuple[ast.AST, str, int | None, ast.AST]]:
    """All places that can be changed, each with a replacement."""
    for parent, field, place in _places(tree):
        holder = getattr(parent, field)
        for other in replacements(holder if place is None else holder[place]):
            yield parent, field, place, other


def _function_lines(functions: Sequence[ast.FunctionDef], node: Any) -> range:
    """Lines of the innermost function whose body holds a node; empty if there is none."""
    at = node.lineno, node.col_offset
    holding = [f for f in functions if (f.body[0].lineno, f.body[0].col_offset) <= at and node.lineno <= f.end_lineno]
    if not holding:
        return range(0)
    inner = max(holding, key=lambda f: (f.lineno, f.col_offset))
    return range(first_line(inner), (inner.end_lineno or 0) + 1)


def _set_node(parent: ast.AST, field: str, place: int | None, node: ast.AST) -> None:
    if place is None:
        setattr(parent, field, node)
    else:
        getattr(parent, field)[place] = node


def sample_of(packages: Sequence[str], count: int, seed: int) -> list[Mutant]:
    """Draw a number of mutants of some packages at random, without repetition."""
    paths = [path for name in packages for path in sorted((SOURCE / name).rglob("*.py")) if path.name != "__init__.py"]
    counts = [sum(1 for _ in _changes(ast.parse(path.read_text(encoding="utf-8")))) for path in paths]
    ends = np.cumsum(counts)
    chosen = np.random.default_rng(seed).permutation(int(ends[-1]))[:count]
    return [
        mutant
        for path, many, end in zip(paths, counts, ends, strict=True)
        if (wanted := {int(k) - (int(end) - many) for k in chosen if end - many <= k < end})
        for mutant in mutants_of(path, wanted)
    ]
