"""AprilTags or ArUco markers on one rigid body, each with its own pose."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field
from pydantic import model_validator as checks_whole

from basecal.cell.format.plain import pose_dict
from basecal.cell.target import Marker, Sheet, Tags, Target
from basecal.cell.targets.fiducials import DICTIONARIES, FAMILIES, cell_count
from basecal.cell.targets.kind import Fields, KindDescription, TargetEntry, TargetKind
from basecal.fields.values import (
    MOST_POINTS,
    Length,
    PoseEntry,
    check_full_pose,
    given_fields,
    known_name_validator,
    pose_se3,
)
from basecal.geometry import SE3

# White margin in cells: detectors need one; two keep the background out of a blurred corner.
_MARGIN_CELLS = 2


def apriltag_target(family: str, tags: list[tuple[int, float, SE3]]) -> Target:
    """Target of tags given as (id, size [m], target_from_tag); corner ids are 4 * tag + corner.

    Corners are ordered clockwise from the tag's top left in its reading orientation; x right, y down, z into the tag.
    """
    corners = 0.5 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=np.float64)
    ordered = sorted(tags, key=lambda tag: tag[0])
    numbers = np.array([number for number, _, _ in ordered])
    corner_ids = 4 * numbers[:, None] + np.arange(4)
    listed = [{"id": int(number), "size_m": float(size), **pose_dict(pose)} for number, size, pose in ordered]
    return Target(
        "apriltag",
        corner_ids.ravel(),
        np.concatenate([pose @ (size * corners) for _, size, pose in ordered]),
        {"family": family, "tags": listed},
        sheets=tuple(_sheet(family, *tag) for tag in ordered),
        found_by="tags",
        tags=Tags(family, numbers, corner_ids),
    )


def _sheet(family: str, number: int, size: float, target_from_sheet: SE3) -> Sheet:
    edge = size / 2 + _MARGIN_CELLS * size / (cell_count(family) + 2)
    marker = Marker(family, number, -size / 2, -size / 2, size)
    return Sheet(np.array([-edge, -edge, edge, edge]), size, markers=(marker,), target_from_sheet=target_from_sheet)


class TagEntry(PoseEntry):
    """One tag with its pose in the target's frame; a single tag at the origin needs no pose."""

    id: Annotated[int, Field(ge=0, le=1_000_000)]
    size_m: Length

    @checks_whole(mode="after")
    def _check_pose(self) -> TagEntry:
        if given_fields(self):
            check_full_pose(self)
        return self


def _check_tags(tags: list[TagEntry]) -> list[TagEntry]:
    numbers = [tag.id for tag in tags]
    twice = [number for index, number in enumerate(numbers) if number in numbers[:index]]
    if twice:
        raise ValueError(f"tag {twice[0]} is given twice")
    unposed = [tag.id for tag in tags if not given_fields(tag)]
    if unposed and len(tags) > 1:
        raise ValueError(f"tag {unposed[0]} has no pose; of several tags each needs t_m and a rotation")
    return tags


class ApriltagEntry(TargetEntry):
    """Tags on one body."""

    kind: Literal["apriltag"]
    family: Annotated[str, known_name_validator("family", (*FAMILIES, *DICTIONARIES))]
    tags: Annotated[list[TagEntry], Field(min_length=1, max_length=MOST_POINTS), AfterValidator(_check_tags)]

    def shape(self) -> Target:
        """Return the target."""
        posed = [(tag.id, tag.size_m, pose_se3(tag) if given_fields(tag) else SE3.identity()) for tag in self.tags]
        return apriltag_target(self.family, posed)


def _renumber_tags(fields: Fields, index: int) -> Fields:
    """Fields of a copy of the target, with tag numbers after those of the `index` copies before it."""
    numbers = [tag["id"] for tag in fields["tags"]]
    step = max(numbers) - min(numbers) + 1
    return {**fields, "tags": [{**tag, "id": tag["id"] + index * step} for tag in fields["tags"]]}


KIND = TargetKind(
    entries=(ApriltagEntry,),
    description=KindDescription(
        "`family`, `tags: [{id, size_m, t_m, q_xyzw}, ...]`", "4 * tag + corner", "as the tags' poses say"
    ),
    template="""\
    kind: apriltag
    family: tag36h11
    tags:                            # where each tag is on the target; ids are 4 * tag + corner
      - {id: 0, size_m: 0.08, t_m: [0, 0, 0], q_xyzw: [0, 0, 0, 1]}
""",
    usual=lambda _: apriltag_target("tag36h11", [(0, 0.12, SE3.identity())]),
    printed=lambda sizes: {
        "family": sizes.family,
        "tags": [{"id": sizes.tag, "size_m": sizes.square_m, "t_m": [0, 0, 0], "q_xyzw": [0, 0, 0, 1]}],
    },
    marks=lambda fields: frozenset(f"{fields['family']} {tag['id']}" for tag in fields["tags"]),
    numbered_fields=_renumber_tags,
    figures={"apriltag": apriltag_target("tag36h11", [(0, 0.16, SE3.identity())])},
)
