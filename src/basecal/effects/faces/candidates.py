"""Candidates of a score test: effects of one kind, and how views move with the size of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from basecal.effects.faces.views import Views
from basecal.geometry import Array


@dataclass(frozen=True, eq=False)
class Candidates:
    """Effects of one kind that may be in the data, each with as many sizes.

    Attributes:
        code: Kind of candidate, such as `joint-offset`; the words of its effect go by it.
        about: Of each, the robot, camera, target or transform that has it.
        since: Of each, the number of the first sample that has it; None if all samples do.
        unit: Unit of the sizes.
        moves: By group of views, (n, b, 6, q) right tangents of `camera_from_target` by unit sizes of b candidates. It
            is None for a group that no candidate moves.
        joint: Of each, the number of the joint that has it, from 0; empty if none has one.
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

    def single(self, index: int) -> Candidates:
        """One of them."""
        moves = tuple(None if m is None else m[:, index : index + 1].copy() for m in self.moves)
        joint = self.joint[index : index + 1]
        return Candidates(self.code, (self.about[index],), (self.since[index],), self.unit, moves, joint)

    def join_sizes(self) -> Candidates:
        """All of them as one, which has the sizes of all."""
        moves = (None if m is None else np.moveaxis(m, 1, 2).reshape(len(m), 1, 6, -1) for m in self.moves)
        return Candidates(self.code, self.about[:1], self.since[:1], self.unit, tuple(moves))


def one_candidate(code: str, subject: str, unit: str, moves: tuple[Array | None, ...]) -> Candidates:
    """A candidate alone, whose moves are (n, 6, q) by group."""
    return Candidates(code, (subject,), (None,), unit, tuple(None if m is None else m[:, None] for m in moves))


def combine_candidates(candidates: Sequence[Candidates], views: Views) -> Candidates:
    """Candidates, each alone of its kind, as one that has the sizes of all."""

    def moves(k: int) -> Array:
        """Moves of a group by all sizes, (n, 1, 6, q)."""
        still = np.zeros((len(views.groups[k]), 1, 6, 0))
        parts = [(np.zeros((*still.shape[:3], each.sizes)), each.moves[k]) for each in candidates]
        return np.concatenate([still, *(none if own is None else own for none, own in parts)], axis=-1)

    return Candidates("", ("",), (None,), "", tuple(map(moves, range(len(views.groups)))))
