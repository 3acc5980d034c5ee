"""What pydantic found wrong, in words for who wrote the file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from basecal.cell.targets.all_kinds import KIND_NAMES, entry_with_tag
from basecal.errors import nearest
from basecal.fields.problems import Loc, Problem, short

_WORDS = {
    "missing": "missing; add it",
    "model_type": "expected a mapping `{field: value}`",
    "dict_type": "expected a mapping `{name: ...}`",
    "list_type": "expected a list",
    "string_type": "expected text",
    "float_type": "expected a number",
    "int_type": "expected a whole number",
    "finite_number": "expected a finite number",
    "bool_type": "expected true or false",
}
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+")


def problems_of(error: ValidationError, model: type[BaseModel]) -> list[Problem]:
    """Each error of a model as a problem at the place where it is written."""
    return [_problem(details, model) for details in error.errors(include_url=False)]


def _problem(details: Mapping[str, Any], model: type[BaseModel]) -> Problem:
    loc = tuple(part for part in details["loc"] if not _is_tag(part))
    kind, value = details["type"], details["input"]
    if kind == "extra_forbidden":
        known = _fields_at(model, details["loc"][:-1])
        return Problem(loc, f"unknown field{nearest(str(loc[-1]), known)}; known: {', '.join(known)}")
    if kind == "union_tag_invalid":
        written = value["kind"]
        hint = nearest(written, KIND_NAMES) if isinstance(written, str) else ""
        return Problem((*loc, "kind"), f"no kind {short(written)}{hint}; there are: {', '.join(KIND_NAMES)}")
    if kind == "value_error":
        return Problem(loc, str(details["ctx"]["error"]))
    if kind == "missing":
        return Problem(loc, _WORDS[kind])
    words = _WORDS.get(kind) or details["msg"].replace("Input should be", "expected")
    has_comma = kind == "float_type" and isinstance(value, str) and _DECIMAL_COMMA.fullmatch(value)
    hint = f"; write a decimal point: {value.replace(',', '.')}" if has_comma else ""
    return Problem(loc, f"{words}, got {short(value)}{hint}")


def _is_tag(part: str | int) -> bool:
    return isinstance(part, str) and entry_with_tag(part) is not None


def _fields_at(model: type[BaseModel], loc: Loc) -> list[str]:
    """Names of the fields of the entry at a place."""
    here: Any = model
    for part in loc:
        here = _bare(here)
        if _is_tag(part):
            here = entry_with_tag(str(part))
        elif _is_model(here):
            here = next((f.annotation for name, f in here.model_fields.items() if part in (name, f.alias)), None)
        else:
            here = get_args(here)[-1] if get_args(here) else None
    entry = _bare(here)
    return [field.alias or name for name, field in entry.model_fields.items()] if _is_model(entry) else []


def _bare(annotation: Any) -> Any:
    """An annotation without its metadata and without `| None`."""
    while get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    if get_origin(annotation) in (Union, UnionType):
        some = [option for option in get_args(annotation) if option is not type(None)]
        return _bare(some[0]) if len(some) == 1 else annotation
    return annotation


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)
