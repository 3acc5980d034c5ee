"""Translation of pydantic's errors for the author of a file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError

from basecal.cell.targets.registry import TARGETS, entry_with_tag
from basecal.errors import spelling_hint
from basecal.fields.problems import Loc, Problem, dataset_error, field_name, shorten

_MESSAGES = {
    "missing": "missing; add it",
    "model_type": "expected a mapping `{field: value}`",
    "dataclass_type": "expected a mapping `{field: value}`",
    "dict_type": "expected a mapping `{name: ...}`",
    "list_type": "expected a list",
    "tuple_type": "expected a list",
    "string_type": "expected text",
    "float_type": "expected a number",
    "int_type": "expected a whole number",
    "finite_number": "expected a finite number",
    "bool_type": "expected true or false",
}
_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")  # of models and of dataclasses
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+")


M = TypeVar("M", bound=BaseModel)


def check_entry(model: type[M], data: Any, path: str, lines: Mapping[Loc, int] | None = None, loc: Loc = ()) -> M:
    """Validate data as an entry of a file.

    Args:
        model: Model of the entry.
        data: Plain data.
        path: The file of the data.
        lines: Line numbers of the file, by location.
        loc: Location of the entry in the file.

    Raises:
        DatasetError: if the data are invalid; the message has a line for each error.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        problems = [Problem((*loc, *each.loc), each.message) for each in collect_problems(error, model)]
        raise dataset_error(path, problems, lines or {}) from None


def check_schema(data: Any, schema: str, path: str, lines: Mapping[Loc, int]) -> dict[str, Any]:
    """Check that the data of a file are a mapping of this schema, and return them.

    Raises:
        DatasetError: if they are not.
    """
    if not isinstance(data, dict):
        problem = Problem((), f"expected a mapping that starts with `schema: {schema}`, got {shorten(data)}")
    elif data.get("schema") != schema:
        got = shorten(data["schema"]) if "schema" in data else "none"
        problem = Problem(("schema",), f"expected {schema}, the one version this program reads, got {got}")
    else:
        return data
    raise dataset_error(path, [problem], lines)


def first_problem(error: ValidationError, model: type[BaseModel] | TypeAdapter[Any]) -> str:
    """Location and text of a model's first error."""
    problem = collect_problems(error, model)[0]
    return f"{field_name(problem.loc)}: {problem.message}"


def collect_problems(error: ValidationError, model: type[BaseModel] | TypeAdapter[Any]) -> list[Problem]:
    """Convert the errors of a model to problems with their locations in the file."""
    schema = model.core_schema if isinstance(model, TypeAdapter) else model.__pydantic_core_schema__
    return [_problem(details, schema) for details in error.errors(include_url=False)]


def _problem(details: Mapping[str, Any], schema: Any) -> Problem:
    loc = tuple(part for part in details["loc"] if not _is_tag(part))
    kind, value = details["type"], details["input"]
    if kind in _UNKNOWN:
        known = _field_names(schema, details["loc"][:-1])
        return Problem(loc, f"unknown field{spelling_hint(str(loc[-1]), known)}; known: {', '.join(known)}")
    if kind == "union_tag_invalid":
        kind_name = value["kind"]
        hint = spelling_hint(kind_name, TARGETS) if isinstance(kind_name, str) else ""
        return Problem((*loc, "kind"), f"no kind {shorten(kind_name)}{hint}; there are: {', '.join(TARGETS)}")
    if kind == "value_error":
        return Problem(loc, str(details["ctx"]["error"]))
    if kind == "missing":
        return Problem(loc, _MESSAGES[kind])
    words = _MESSAGES.get(kind) or details["msg"].replace("Input should be", "expected")
    has_comma = kind == "float_type" and isinstance(value, str) and _DECIMAL_COMMA.fullmatch(value)
    hint = f"; write a decimal point: {value.replace(',', '.')}" if has_comma else ""
    return Problem(loc, f"{words}, got {shorten(value)}{hint}")


def _is_tag(part: str | int) -> bool:
    return isinstance(part, str) and entry_with_tag(part) is not None


def _field_names(schema: Any, loc: Loc) -> list[str]:
    """Names of the fields of the entry at a location, from pydantic's core schema."""
    definitions = {each["ref"]: each for each in schema.get("definitions", ())}
    entry_schema = _unwrap_schema(schema, definitions)
    for part in loc:
        entry_schema = _unwrap_schema(_inner(entry_schema, part), definitions)
    return list(_fields(entry_schema))


def _inner(schema: Any, part: str | int) -> Any:
    """Schema of the value at a key of a mapping, or at an index of a list."""
    match schema["type"]:
        case "dict":
            return schema["values_schema"]
        case "tuple":
            return schema["items_schema"][0]
        case "tagged-union":
            return schema["choices"][part]
        case "list":
            return schema["items_schema"]
    return _fields(schema)[str(part)]


def _fields(schema: Any) -> dict[str, Any]:
    """Schemas of the fields of an entry, by their names in files."""
    fields = schema.get("fields", ())
    named = fields.items() if isinstance(fields, dict) else ((field["name"], field) for field in fields)
    return {field.get("validation_alias", name): field["schema"] for name, field in named}


def _unwrap_schema(schema: Any, definitions: Mapping[str, Any]) -> Any:
    """Schema without its wrappers: defaults, validators, `| None`."""
    while "schema" in schema or schema["type"] == "definition-ref":
        schema = definitions[schema["schema_ref"]] if schema["type"] == "definition-ref" else schema["schema"]
    return schema
