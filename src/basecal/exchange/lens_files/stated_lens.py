"""A lens that a file states, as a camera of this project."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from basecal.cell.format.plain import numbers
from basecal.errors import InputError
from basecal.exchange.fields import Field
from basecal.geometry import SE3, Camera

OPENCV_TERMS = (0, 4, 5, 8, 12)
"""Distortion terms of the pinhole that lenses here have, in OpenCV's order; it knows two more, of a tilted sensor."""

_TILTED_TERMS = 14


@dataclass(frozen=True, eq=False)
class StatedLens:
    """A lens in a file.

    Attributes:
        camera: The lens; the centre of the top-left pixel is (0, 0), whatever the file counts from.
        what: What was read, in words: which model, and where the file begins to count pixels.
        name: What the file calls it; None if it does not.
        camera_from_previous: Where the camera that stands before it in the file is in it, where the file says so.
    """

    camera: Camera
    what: str
    name: str | None = None
    camera_from_previous: SE3 | None = None


def made_camera(field: Field, model: str, parameters: Sequence[float], size_px: tuple[int, int] | None) -> Camera:
    """The camera of fx, fy, cx, cy [px] and distortion terms that stand at a place of a file.

    Raises:
        DatasetError: if they are no lens.
    """
    try:
        return Camera(model, np.array(parameters, dtype=np.float64), size_px)
    except InputError as error:
        raise field.error(str(error)) from None


def opencv_terms(field: Field, terms: Sequence[float]) -> list[float]:
    """Distortion terms in OpenCV's order, without those of a sensor that is not tilted.

    Raises:
        DatasetError: if there is no lens of so many terms, or the sensor is tilted.
    """
    if len(terms) == _TILTED_TERMS:
        if any(terms[-2:]):
            raise field.error(
                "the last two of 14 terms tilt the sensor, which no lens here does: calibrate without them"
            )
        terms = terms[:-2]
    if len(terms) not in OPENCV_TERMS:
        known = " or ".join(map(str, (*OPENCV_TERMS, _TILTED_TERMS)))
        raise field.error(f"has {len(terms)} distortion terms, expected {known}, in OpenCV's order")
    return list(terms)


def matrix_parameters(field: Field, matrix: Sequence[float]) -> list[float]:
    """fx, fy, cx, cy of the nine numbers of a camera matrix, row by row.

    Raises:
        DatasetError: if they are none, or its axes are not at right angles.
    """
    fx, skew, cx, lower, fy, cy, *last = matrix
    if not any(matrix[:6]):
        raise field.error("is all zero: the camera is not calibrated; calibrate it, or leave its intrinsics free")
    if lower or list(last) != [0.0, 0.0, 1.0]:
        raise field.error("is not a camera matrix, row by row: fx 0 cx, 0 fy cy, 0 0 1; is it transposed?")
    if skew:
        raise field.error(f"has a skew of {skew:g} px, which no lens here has: calibrate without it")
    return [fx, fy, cx, cy]


def camera_entry(camera: Camera, status: str) -> dict[str, Any]:
    """Entry of `cell.yaml` for a lens: its model, size and intrinsics."""
    fx, fy, cx, cy, *terms = numbers(camera.parameters)
    size = {} if camera.size_px is None else {"size_px": list(camera.size_px)}
    lens = {"status": status, "fx": fx, "fy": fy, "cx": cx, "cy": cy, "distortion": terms}
    return {"model": camera.model, **size, "intrinsics": lens}
