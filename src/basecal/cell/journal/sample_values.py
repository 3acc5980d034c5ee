"""Fast validation of numbers, ids and poses of a recorded line: a recording has millions of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import ValidationError

from basecal.cell.schema.errors import collect_problems
from basecal.errors import DatasetError, count_text, spelling_hint
from basecal.fields.problems import SHORT_LENGTH, shorten
from basecal.fields.values import LARGEST_VALUE, SMALLEST_SIGMA, PoseEntry, check_full_pose, pose_se3
from basecal.geometry import SE3, Array, IntArray
from basecal.geometry.rotation import ROTATION_TOLERANCE

_SIGMAS = {"sigma_t_m", "sigma_r_rad"}


@dataclass(frozen=True)
class FileLine:
    """A line of a file."""

    path: str
    line: int

    def error(self, field: str, message: str) -> DatasetError:
        """An error about a field of the line."""
        return DatasetError(self.path, message, self.line, field or None)

    def mapping(self, value: Any, field: str, known_names: tuple[str, ...] | None = None) -> dict[str, Any]:
        """Check that a value is a mapping with known keys only, and return it.

        Raises:
            DatasetError: if it is not.
        """
        if not isinstance(value, dict):
            raise self.error(field, f"expected an object {{...}}, got {shorten(value)}")
        if known_names is not None:
            for name in value:
                if name not in known_names:
                    location = f"{field}.{name}" if field else name
                    hint = spelling_hint(name[:SHORT_LENGTH], known_names)
                    raise self.error(location, f"unknown field{hint}; known: {', '.join(known_names)}")
        return value

    def name(self, value: Any, field: str, kind: str, known_names: Any) -> str:
        """Check that a value is one of the known names, and return it.

        Raises:
            DatasetError: if it is not.
        """
        if isinstance(value, str) and value in known_names:
            return value
        hint = spelling_hint(value[:SHORT_LENGTH], known_names) if isinstance(value, str) else ""
        names = ", ".join(known_names) or "none"
        raise self.error(field, f"no {kind} {shorten(value)}{hint}; cell.yaml has: {names}")


def number(file_line: FileLine, field: str, value: Any, largest: float) -> float:
    """Check that a value is a finite number within +-`largest`, and return it.

    Raises:
        DatasetError: if it is not.
    """
    if not isinstance(value, int | float) or not abs(value) <= largest:
        raise file_line.error(field, f"expected a finite number within {largest:g}, got {shorten(value)}")
    return float(value)


def numbers(file_line: FileLine, field: str, value: Any, columns: int | None = None) -> Array:
    """Convert a list to a read-only array of numbers, (n,), or of rows, (n, columns).

    Raises:
        DatasetError: if the value is not such a list, or a number is not finite or beyond 1e6.
    """
    expected = "a list of numbers" if columns is None else f"a list of rows of {columns} numbers"
    array = _array(value)
    if columns is not None and array is not None and array.shape == (0,):
        array = array.reshape(0, columns)
    row = () if columns is None else (columns,)
    if array is None or array.dtype.kind not in "iuf" or array.ndim != 1 + len(row) or array.shape[1:] != row:
        raise file_line.error(field, f"expected {expected}, got {_invalid_item(value, columns)}")
    # The comparison is also false for NaN.
    if not (np.abs(array) <= LARGEST_VALUE).all():
        got = f"holds NaN, infinity or a number beyond {LARGEST_VALUE:g}"
        raise file_line.error(field, f"{got}: {_invalid_item(value, columns)}; expected {expected}")
    checked: Array = array.astype(np.float64)
    checked.setflags(write=False)
    return checked


def _invalid_item(value: Any, columns: int | None) -> str:
    """Text of the first invalid item and its index; of the whole value if no item is invalid."""
    for index, item in enumerate(value if isinstance(value, list) else ()):
        row = [item] if columns is None else item
        if not isinstance(row, list) or len(row) != (columns or 1) or not all(map(_is_number, row)):
            hint = ": leave that one out" if item is None or (isinstance(item, list) and None in item) else ""
            words = f"[{', '.join(map(_value_text, item))}]" if isinstance(item, list) else _value_text(item)
            return f"{words if len(words) <= SHORT_LENGTH else shorten(item)} in row {index}, counted from 0{hint}"
    return shorten(value)


def _value_text(value: Any) -> str:
    return "null" if value is None else shorten(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and abs(value) <= LARGEST_VALUE


def _array(value: Any) -> np.ndarray[Any, Any] | None:
    if not isinstance(value, list):
        return None
    try:
        return np.array(value)
    except ValueError:
        return None


def whole_numbers(file_line: FileLine, field: str, value: Any) -> IntArray:
    """Convert a list to a read-only array of whole numbers, (n,).

    Raises:
        DatasetError: if the value is not a list of whole numbers.
    """
    array = _array(value)
    if array is None or array.ndim != 1 or (array.size and array.dtype.kind != "i"):
        raise file_line.error(field, f"expected a list of whole numbers, got {shorten(value)}")
    whole: IntArray = array.astype(np.int64)
    whole.setflags(write=False)
    return whole


def sigmas(file_line: FileLine, field: str, value: Any, count: int) -> Array | None:
    """Convert one number, or a list of `count`, to positive sigmas, (count,); None if not stated.

    Raises:
        DatasetError: if the value is invalid.
    """
    if value is None:
        return None
    if not isinstance(value, list):
        value = [number(file_line, field, value, LARGEST_VALUE)] * count
    array = numbers(file_line, field, value)
    if len(array) != count:
        raise file_line.error(field, f"expected one positive number or {count}, got {len(array)}")
    if not (array >= SMALLEST_SIGMA).all():
        raise file_line.error(field, "expected positive numbers")
    return array


def vector(file_line: FileLine, field: str, value: Any, count: int) -> list[float]:
    """Check that a value is a list of exactly `count` finite numbers, and return it; faster here without NumPy.

    Raises:
        DatasetError: if it is not.
    """
    if not isinstance(value, list) or len(value) != count:
        raise file_line.error(field, f"expected {count_text(count, 'number')}, got {shorten(value)}")
    for item in value:
        if not isinstance(item, int | float) or not -LARGEST_VALUE <= item <= LARGEST_VALUE:
            raise file_line.error(
                field, f"expected {count_text(count, 'finite number')} within {LARGEST_VALUE:g}, got {shorten(item)}"
            )
    return value


def pose(file_line: FileLine, field: str, value: Any, with_sigmas: bool = False) -> tuple[SE3, Array | None]:
    """Read a transform and its sigmas, (6,) [m, rad]; None if not stated.

    Raises:
        DatasetError: if the value is not exactly a position and one rotation, with or without sigmas.
    """
    fields = file_line.mapping(value, field)
    sigma = None
    if with_sigmas and fields.keys() & _SIGMAS:
        if not fields.keys() >= _SIGMAS:
            raise file_line.error(field, "sigma_t_m and sigma_r_rad go together; give both or neither")
        parts = [sigmas(file_line, f"{field}.{name}", fields[name], 3) for name in ("sigma_t_m", "sigma_r_rad")]
        if any(part is None for part in parts):
            raise file_line.error(field, "expected positive sigma_t_m and sigma_r_rad, got null")
        sigma = np.concatenate([part for part in parts if part is not None])
        sigma.setflags(write=False)
        fields = {key: item for key, item in fields.items() if key not in _SIGMAS}
    if fields.keys() != {"t_m", "q_xyzw"}:
        return _any_pose(file_line, field, fields), sigma
    t = np.array(vector(file_line, f"{field}.t_m", fields["t_m"], 3), dtype=np.float64)
    q = vector(file_line, f"{field}.q_xyzw", fields["q_xyzw"], 4)
    norm = math.hypot(*q)
    if abs(norm - 1) > ROTATION_TOLERANCE:
        expected = f"expected 1 within {ROTATION_TOLERANCE:g}; the order is x, y, z, w"
        raise file_line.error(f"{field}.q_xyzw", f"has norm {norm:.6g}, {expected}")
    return SE3(_rotation(*(x / norm for x in q)), t), sigma


def _rotation(x: float, y: float, z: float, w: float) -> Array:
    # Written out for one quaternion: ten times faster than the code for batches.
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _any_pose(file_line: FileLine, field: str, fields: dict[str, Any]) -> SE3:
    """Read a pose in one of the less common notations."""
    try:
        return pose_se3(check_full_pose(PoseEntry.model_validate(fields)))
    except ValidationError as error:
        problem = collect_problems(error, PoseEntry)[0]
        raise file_line.error(".".join([field, *map(str, problem.loc)]), problem.message) from None
    except ValueError as error:
        raise file_line.error(field, str(error)) from None
