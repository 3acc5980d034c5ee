"""The targets of `cell.yaml`: one model a kind."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag
from pydantic import model_validator as checks_whole

from basecal.cell.schema.fiducials import DICTIONARIES, FAMILIES
from basecal.cell.schema.values import (
    MOST_POINTS,
    Corners,
    Entry,
    Length,
    Mount,
    PointMount,
    PoseEntry,
    Squares,
    UnknownEntry,
    Vector,
    full_pose,
    given,
)
from basecal.errors import nearest

KINDS = ("points", "led", "charuco", "chessboard", "circles", "apriltag")


def _known(what: str, names: tuple[str, ...]) -> AfterValidator:
    def check(name: str) -> str:
        """The name, if it is known."""
        if name not in names:
            raise ValueError(f"no {what} {name[:60]!r}{nearest(name[:60], names)}; there are: {', '.join(names)}")
        return name

    return AfterValidator(check)


class PosesOnlyEntry(Entry):
    """A target seen only as poses."""

    on: str
    mount: Mount = UnknownEntry()


class PointEntry(Entry):
    """One light or one point."""

    on: str
    mount: PointMount = UnknownEntry()
    kind: Literal["points", "led"]
    points_m: Annotated[list[Vector], Field(min_length=1, max_length=1)] | None = None

    @checks_whole(mode="after")
    def _has_point(self) -> PointEntry:
        if self.kind == "points" and self.points_m is None:
            raise ValueError("kind points needs points_m: [[x, y, z], ...]")
        return self


class PointsEntry(Entry):
    """Several lights or points of one body."""

    on: str
    mount: Mount = UnknownEntry()
    kind: Literal["points", "led"]
    points_m: Annotated[list[Vector], Field(min_length=2)]


class CharucoEntry(Entry):
    """A ChArUco board."""

    on: str
    mount: Mount = UnknownEntry()
    kind: Literal["charuco"]
    squares: Squares
    square_m: Length
    marker_m: Length
    dictionary: Annotated[str, _known("dictionary", DICTIONARIES)]
    legacy_pattern: bool = False

    @checks_whole(mode="after")
    def _marker_fits(self) -> CharucoEntry:
        if self.marker_m >= self.square_m:
            raise ValueError(f"marker_m {self.marker_m} is not below square_m {self.square_m}")
        return self


class ChessboardEntry(Entry):
    """A chessboard, counted by inner corners."""

    on: str
    mount: Mount = UnknownEntry()
    kind: Literal["chessboard"]
    corners: Corners
    square_m: Length


class CirclesEntry(Entry):
    """A grid of circles."""

    on: str
    mount: Mount = UnknownEntry()
    kind: Literal["circles"]
    circles: Corners
    spacing_m: Length
    asymmetric: bool = False


class TagEntry(PoseEntry):
    """One tag, with its pose in the target's frame; one at its origin may leave the pose out."""

    id: Annotated[int, Field(ge=0, le=1_000_000)]
    size_m: Length

    @checks_whole(mode="after")
    def _posed(self) -> TagEntry:
        if given(self):
            full_pose(self)
        return self


def _distinct(tags: list[TagEntry]) -> list[TagEntry]:
    numbers = [tag.id for tag in tags]
    twice = [number for index, number in enumerate(numbers) if number in numbers[:index]]
    if twice:
        raise ValueError(f"tag {twice[0]} is given twice")
    unposed = [tag.id for tag in tags if not given(tag)]
    if unposed and len(tags) > 1:
        raise ValueError(f"tag {unposed[0]} has no pose; of several tags each needs t_m and a rotation")
    return tags


class ApriltagEntry(Entry):
    """Tags on one body."""

    on: str
    mount: Mount = UnknownEntry()
    kind: Literal["apriltag"]
    family: Annotated[str, _known("family", (*FAMILIES, *DICTIONARIES))]
    tags: Annotated[list[TagEntry], Field(min_length=1, max_length=MOST_POINTS), AfterValidator(_distinct)]


def _kind(data: Any) -> str:
    """Which model reads an entry; in angle brackets, so that no error mistakes it for a field."""
    kind = data.get("kind") if isinstance(data, dict) else None
    if kind in ("points", "led"):
        points = data.get("points_m")
        return "<points>" if isinstance(points, list) and len(points) > 1 else "<point>"
    return "<poses>" if kind is None else f"<{kind}>"


TargetEntry = Annotated[
    Annotated[PosesOnlyEntry, Tag("<poses>")]
    | Annotated[PointEntry, Tag("<point>")]
    | Annotated[PointsEntry, Tag("<points>")]
    | Annotated[CharucoEntry, Tag("<charuco>")]
    | Annotated[ChessboardEntry, Tag("<chessboard>")]
    | Annotated[CirclesEntry, Tag("<circles>")]
    | Annotated[ApriltagEntry, Tag("<apriltag>")],
    Discriminator(_kind),
]
