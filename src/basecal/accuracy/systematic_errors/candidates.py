"""What a systematic error does to views: a table of rows, each a cause and how views move with its size."""

from __future__ import annotations

from dataclasses import dataclass

from basecal.geometry import Array


@dataclass(frozen=True, eq=False)
class Candidates:
    """Errors of one kind that may be in the data, each with as many sizes.

    Attributes:
        code: Of the finding that names it.
        about: Of each, the robot, camera or transform that has it.
        since: Of each, the number of the first sample that has it; None where all do.
        unit: What one unit of a size is, in words.
        moves: By group of views, (n, b, 6, q): right tangents of `camera_from_target` by unit sizes, of b errors; None
            where they move no view of the group.
        joint: Of each, the number of the joint that has it, from 0; empty where none do.
    """

    code: str
    about: tuple[str, ...]
    since: tuple[int | None, ...]
    unit: str
    moves: tuple[Array | None, ...]
    joint: tuple[int, ...] = ()

    @property
    def sizes(self) -> int:
        """How many sizes each has."""
        return int(next(m.shape[-1] for m in self.moves if m is not None))

    def only(self, which: int) -> Candidates:
        """One of them."""
        moves = tuple(None if m is None else m[:, which : which + 1].copy() for m in self.moves)
        joint = self.joint[which : which + 1]
        return Candidates(self.code, (self.about[which],), (self.since[which],), self.unit, moves, joint)
