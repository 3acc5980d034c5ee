"""Conversion between a calibration and the plain data of `calibration.json`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from basecal.cell.calibration import Calibration, Finding
from basecal.cell.results.calibration_model import CalibrationFile
from basecal.cell.results.versions import program_version
from basecal.cell.schema.errors import first_problem
from basecal.cell.work_error import BudgetEntry
from basecal.effects.faces.robot_parameter import RobotParameters
from basecal.effects.registry import ROBOT_PARAMETERS
from basecal.errors import InputError, check_type, list_names, spelling_hint
from basecal.fields.file_forms import LARGEST_NUMBER
from basecal.fields.problems import CAUSE_LENGTH, SHORT_LENGTH, Loc, Problem, field_name

SCHEMA = "basecal/calibration/1"
_FILE, _BUDGET_ENTRY, _FINDING = (TypeAdapter[Any](model) for model in (CalibrationFile, BudgetEntry, Finding))


def calibration_to_dict(calibration: Calibration) -> dict[str, Any]:
    """Convert a calibration to the data of `calibration.json`; values not computed or not finite become None.

    Raises:
        InputError: if the argument is not a calibration.
    """
    check_type("calibration", calibration, Calibration)
    robot_parameters: dict[str, Any] = {}
    for name, each in ROBOT_PARAMETERS.items():
        robot_parameters |= each.to_dict(calibration.robot_parameters.get(name, {}))
    data = _data(_FILE, CalibrationFile.from_calibration(calibration))
    findings = [finding_to_dict(finding) for finding in calibration.findings]
    leading = {key: data.pop(key) for key in ("verdict", "transforms", "intrinsics")}
    header = {"schema": SCHEMA, "version": program_version()}
    plain: dict[str, Any] = _plain(header | leading | robot_parameters | data | {"findings": findings})
    return plain


def budget_entry(entry: BudgetEntry) -> dict[str, Any]:
    """Convert an entry of an error budget to JSON data."""
    return _data(_BUDGET_ENTRY, entry)


def finding_to_dict(finding: Finding) -> dict[str, Any]:
    """Convert a finding to JSON data."""
    plain: dict[str, Any] = _plain(_data(_FINDING, finding) | {"message": finding.message})
    return plain


def calibration_from_dict(data: Any) -> Calibration:
    """Create a calibration from the data of a `calibration.json`.

    Raises:
        InputError: if the schema differs, or a field is missing, unknown or invalid.
    """
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        got = data.get("schema") if isinstance(data, dict) else type(data).__name__
        raise InputError(
            f"expected the schema {SCHEMA}, the one version this program reads, got {str(got)[:SHORT_LENGTH]!r}"
        )
    try:
        calibration = _read(data)
    except ValidationError as error:
        problem: Problem | None = Problem((), first_problem(error, _FILE))
    except InputError as error:
        problem = Problem((), str(error))
    except KeyError as error:
        problem = Problem((), f"the field {error} is missing")
    except (TypeError, AttributeError, ValueError, OverflowError) as error:
        problem = Problem((), f"not a calibration as this program writes it ({str(error)[:CAUSE_LENGTH]})")
    else:
        problem = _field_mismatch(data, calibration_to_dict(calibration), ())
    if problem is not None:
        prefix = f"{field_name(problem.loc)}: " if problem.loc else ""
        raise InputError(f"{prefix}{problem.message}; calibrate again")
    return calibration


def _read(data: dict[str, Any]) -> Calibration:
    file: CalibrationFile = _FILE.validate_python(data)
    robot_parameters = {name: _parameters(each.from_dict(data), name) for name, each in ROBOT_PARAMETERS.items()}
    return file.check_fields().calibration({kind: by_robot for kind, by_robot in robot_parameters.items() if by_robot})


def _field_mismatch(data: Any, expected_data: Any, loc: Loc) -> Problem | None:
    """First missing or unknown field of `data`, compared with the data that would be written; None if there is none."""
    parts: list[tuple[str | int, Any, Any]] = []
    if (
        isinstance(data, list)
        and isinstance(expected_data, list)
        and expected_data
        and isinstance(expected_data[0], dict)
    ):
        parts = [(k, *both) for k, both in enumerate(zip(data, expected_data, strict=True))]
    elif isinstance(data, dict) and isinstance(expected_data, dict):
        for name in data:
            if name not in expected_data:
                return Problem(
                    (*loc, name),
                    f"unknown field{spelling_hint(name, expected_data)}; known: {list_names(list(expected_data))}",
                )
        for name in expected_data:
            if name not in data:
                return Problem((*loc, name), "missing; add it")
        parts = [(name, data[name], expected_data[name]) for name in expected_data]
    problems = (_field_mismatch(value, expected, (*loc, part)) for part, value, expected in parts)
    return next((problem for problem in problems if problem is not None), None)


def _data(adapter: TypeAdapter[Any], value: Any) -> dict[str, Any]:
    """Fields of an object by their names in files; arrays are not converted."""
    data: dict[str, Any] = adapter.dump_python(value, by_alias=True, warnings=False)
    return data


def _plain(value: Any) -> Any:
    """Convert values to JSON data: arrays to lists, numbers that are not finite or beyond LARGEST_NUMBER to None."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        # The joint covariance of a hundred robots has millions of numbers.
        is_plain = value.dtype.kind == "f" and bool(np.all(np.abs(value) <= LARGEST_NUMBER))
        return value.tolist() if is_plain else _plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if abs(value) <= LARGEST_NUMBER else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def _parameters(parameters: dict[str, RobotParameters], kind: str) -> dict[str, RobotParameters]:
    for robot, values in parameters.items():
        is_named = all(isinstance(joint, str) for joint in values.joints)
        if not is_named or not values.values.shape == values.sigma.shape == values.seen.shape:
            raise InputError(f"{kind} of {robot!r}: expected a value, a sigma and whether it is seen of each")
    return parameters
