"""Pydantic types of numbers and arrays in results, with conversion between memory and file units."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, GetPydanticSchema, Strict
from pydantic_core import core_schema

from basecal.errors import count_text
from basecal.geometry import SE3, Array, read_only

_FARTHEST = 1e9  # [m, px]: a thousand times the limit of a cell; its square does not overflow
FARTHEST_S = 1e12
"""Largest absolute value of a time stamp [s]."""

LARGEST_NUMBER = 1e150
"""Largest number of any field: larger than any measured value, while its square does not overflow."""


def as_written(form: Any, read: Callable[[Any], Any], write: Callable[[Any], Any]) -> GetPydanticSchema:
    """Annotation of a value that files store as type `form`; file values are validated as `form` before `read`."""

    def schema(_: Any, handler: Any) -> core_schema.CoreSchema:
        """Return the schema of `form` with both conversions."""
        writing = core_schema.plain_serializer_function_ser_schema(write)
        return core_schema.no_info_after_validator_function(read, handler(form), serialization=writing)

    return GetPydanticSchema(schema)


def number_form(form: Any, factor: float) -> GetPydanticSchema:
    """Annotation of a number that files store times `factor`, or as null."""

    def read(value: float | None) -> float | None:
        """Convert the number from a file."""
        return None if value is None else value / factor

    def write(value: float | None) -> float | None:
        """Convert the number for a file."""
        return None if value is None else value * factor

    return as_written(form, read, write)


def array_form(form: Any, factor: float = 1.0, shape: tuple[int, ...] = (-1,)) -> GetPydanticSchema:
    """Annotation of an array that files store as lists of numbers times `factor`."""
    return as_written(
        form,
        lambda rows: read_only(np.array(rows, dtype=np.float64).reshape(shape) / factor),
        lambda array: (np.asarray(array, dtype=np.float64) * factor + 0.0).tolist(),
    )


def _square(rows: list[list[float | None]]) -> Array:
    """Convert rows to a square matrix with non-negative variances; null becomes NaN."""
    if any(len(row) != len(rows) for row in rows):
        raise ValueError(
            f"expected a square, got {count_text(len(rows), 'row')} of {' or '.join(map(str, {len(r) for r in rows}))}"
        )
    values = read_only(np.array(rows, dtype=np.float64).reshape(len(rows), len(rows)))
    bad = (np.diagonal(values) < 0) | np.any(np.abs(values) > LARGEST_NUMBER, axis=1)
    if bad.any():
        first = int(np.argmax(bad))
        raise ValueError(f"row {first} holds a number beyond {LARGEST_NUMBER:g} or a variance below 0")
    return values


THREE = Field(min_length=3, max_length=3)
Whole = Annotated[int, Strict()]
Flag = Annotated[bool, Strict()]
Real = Annotated[float, Strict()]
Number = Annotated[float, Strict(), Field(ge=-_FARTHEST, le=_FARTHEST)]
Length = Annotated[float, Strict(), Field(ge=0, le=_FARTHEST)]
Seconds = Annotated[float, Strict(), Field(ge=-FARTHEST_S, le=FARTHEST_S)]
Sigma = Annotated[float, Strict(), Field(ge=0, le=LARGEST_NUMBER)]
# An error of a fit; None if undefined.
Error = Annotated[float, Strict(), Field(ge=0, le=LARGEST_NUMBER)] | None
ErrorInMm = Annotated[float | None, number_form(Error, 1e3)]
ErrorInDeg = Annotated[float | None, number_form(Error, float(np.degrees(1)))]
Covariance = Annotated[Array, as_written(list[list[Real | None]], _square, lambda array: array + 0.0)]
Vector3 = Annotated[Array, array_form(Annotated[list[Number], THREE])]


class WrittenPose(BaseModel):
    """`t_m` and `q_xyzw` of a transform."""

    model_config = ConfigDict(allow_inf_nan=False, defer_build=True)
    t_m: Annotated[list[Number], THREE]
    q_xyzw: Annotated[list[Real], Field(min_length=4, max_length=4)]

    def transform(self) -> SE3:
        """Return the transform.

        Raises:
            InputError: if the norm of the quaternion is not 1.
        """
        return SE3.from_quaternion(self.q_xyzw, self.t_m)


def pose_data(pose: SE3) -> dict[str, Any]:
    """Convert a transform to `t_m` and `q_xyzw` without negative zeros."""
    return {"t_m": (pose.translation + 0.0).tolist(), "q_xyzw": (pose.quaternion + 0.0).tolist()}


Pose = Annotated[SE3, as_written(WrittenPose, WrittenPose.transform, pose_data)]
