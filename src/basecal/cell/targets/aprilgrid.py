"""Kalibr's aprilgrid: a grid of AprilTags with a black square at each corner of each tag.

Tags, corners and frame are those of Kalibr. Tag 0 is at the lower left of the upright print, numbers increase along
rows, and rows count upwards. The corners of a tag are ordered anticlockwise from its lower left. The origin of the
frame is the lower left corner of tag 0. Its x points right along a row, y up, and z out of the print.
Source: Kalibr's documentation of calibration targets and its printed boards, whose tags have two cells of black border.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from basecal.cell.target import Marker, Sheet, Tags, Target
from basecal.cell.targets.fiducials import FAMILIES
from basecal.cell.targets.kind import KindDescription, TargetEntry, TargetKind, choose_dictionary, plane_grid
from basecal.fields.values import MOST_POINTS, Length, known_name_validator
from basecal.geometry import SE3

_BORDER = 2  # cells, as Kalibr prints
_HALF_TURN = 2  # quarter turns: OpenCV draws AprilTags upside down
# Anticlockwise from the lower left is, in OpenCV's upside-down tag: top right, top left, bottom left, bottom right.
_CORNERS_AS_OPENCV = np.array([1, 0, 3, 2])

TagCounts = Annotated[list[Annotated[int, Field(ge=1, le=MOST_POINTS)]], Field(min_length=2, max_length=2)]
Spacing = Annotated[float, Field(gt=0, le=1)]


def aprilgrid_target(tags: Sequence[int], tag_m: float, spacing: float, family: str = "tag36h11") -> Target:
    """Target of (columns, rows) tags with gaps of `spacing` times the tag size; ids are 4 * tag + corner."""
    columns, rows = tags
    lower_left = plane_grid(columns, rows, tag_m * (1 + spacing))
    corners = tag_m * np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    numbers = np.arange(columns * rows)
    corner_ids = 4 * numbers[:, None] + np.arange(4)
    return Target(
        "aprilgrid",
        corner_ids.ravel(),
        (lower_left[:, None] + corners).reshape(-1, 3),
        {"tags": [columns, rows], "tag_m": tag_m, "spacing": spacing, "family": family},
        sheets=(_sheet(columns, rows, tag_m, spacing, family),),
        found_by="tags",
        tags=Tags(family, numbers, corner_ids[:, _CORNERS_AS_OPENCV], _BORDER, squares=spacing),
    )


def _sheet(columns: int, rows: int, tag_m: float, spacing: float, family: str) -> Sheet:
    """Printed sheet with y downwards; its origin is the target's origin."""
    gap, pitch = tag_m * spacing, tag_m * (1 + spacing)
    square_corners = plane_grid(columns + 1, rows + 1, pitch)[:, :2] * [1, -1] - [gap, 0]
    tag_corners = plane_grid(columns, rows, pitch)[:, :2] * [1, -1] - [0, tag_m]
    markers = [
        Marker(family, k, left, top, tag_m, _BORDER, _HALF_TURN) for k, (left, top) in enumerate(tag_corners.tolist())
    ]
    edge = 2 * gap
    paper = np.array([-edge, -rows * pitch - edge + gap, columns * pitch + edge - gap, edge])
    front = SE3(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
    return Sheet(
        paper,
        tag_m,
        np.concatenate([square_corners, square_corners + gap], -1),
        markers=tuple(markers),
        target_from_sheet=front,
    )


class AprilgridEntry(TargetEntry):
    """Kalibr's grid of AprilTags."""

    kind: Literal["aprilgrid"]
    tags: TagCounts
    tag_m: Length
    spacing: Spacing
    family: Annotated[str, known_name_validator("family", FAMILIES)] = "tag36h11"

    def shape(self) -> Target:
        """Return the target."""
        return aprilgrid_target(self.tags, self.tag_m, self.spacing, self.family)


_LARGE_FAMILIES = ("tag36h11", "tag36h10")  # OpenCV's other families have at most 35 tags, too few for 6 x 6

KIND = TargetKind(
    entries=(AprilgridEntry,),
    description=KindDescription(
        "`tags: [columns, rows]`, `tag_m`, `spacing` (of the tag's size), `family`",
        "4 * tag + corner, both as Kalibr counts",
        "lower left corner of tag 0; y is up",
    ),
    template="""\
    kind: aprilgrid                  # as Kalibr prints it; ids are 4 * tag + corner
    tags: [6, 6]                     # columns, rows of tags
    tag_m: 0.03                      # outer black edge to outer black edge; measure it
    spacing: 0.3                     # gap between tags, in units of their size
    family: tag36h11
""",
    marks=lambda fields: frozenset({fields["family"]}),
    numbered_fields=lambda fields, n: {**fields, "family": choose_dictionary(_LARGE_FAMILIES, fields["family"], n)},
    usual=lambda _: aprilgrid_target((4, 4), 0.042, 0.3),
    printed=lambda sizes: {
        "tags": [sizes.columns, sizes.rows],
        "tag_m": sizes.square_m,
        "spacing": 0.3,
        "family": sizes.family,
    },
    figures={"aprilgrid": aprilgrid_target((2, 2), 0.08, 0.3)},
)
