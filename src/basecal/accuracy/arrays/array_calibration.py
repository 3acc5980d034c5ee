"""Result of a calibration from arrays, with transforms by OpenCV's names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from basecal.accuracy.arrays.words import rename_finding
from basecal.cell import Calibration, Cell, Finding, Recording
from basecal.errors import FrameNotFound, NotObservable
from basecal.geometry import Array, PoseEstimate


@dataclass(frozen=True)
class Alias:
    """The transform of the cell, or its inverse, that another name refers to."""

    transform: str
    is_inverse: bool = False


class _NoTransform(NotObservable, AttributeError):
    """Error for a transform that the arrays do not determine; `hasattr` is false for it."""


@dataclass(frozen=True, eq=False)
class ArrayCalibration:
    """Result of a calibration from arrays.

    `found["cam2gripper"]` is a transform with its covariance (6, 6) [m, rad]. `found.R_cam2gripper` (3, 3) and
    `found.t_cam2gripper` (3, 1) [m] are its mean in the form of OpenCV. `a2b` is `b_from_a`.

    Attributes:
        calibration: The complete calibration, with the names of the cell.
        cell: The cell that represents the arrays.
        recording: The arrays as a recording.
        aliases: Transforms of the cell, by OpenCV's names.
        words: OpenCV's words for the cell's robots, frames and conventions.
    """

    calibration: Calibration
    cell: Cell
    recording: Recording
    aliases: Mapping[str, Alias]
    words: Mapping[str, str] = field(default_factory=dict)

    @property
    def verdict(self) -> str:
        """`good`, `doubtful` or `refused`."""
        return self.calibration.verdict

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Findings with OpenCV's names, the most severe first."""
        words = {alias.transform: name for name, alias in self.aliases.items()} | dict(self.words)
        return tuple(rename_finding(each, words) for each in self.calibration.findings)

    def __getitem__(self, name: str) -> PoseEstimate:
        """Estimate of the transform with this OpenCV name.

        Raises:
            FrameNotFound: if there is no such name.
            NotObservable: if the arrays do not determine the transform.
        """
        if name not in self.aliases:
            raise FrameNotFound(name, list(self.aliases))
        alias = self.aliases[name]
        found = self.calibration.transforms.get(alias.transform)
        if found is None:
            raise _NoTransform(f"{name} was not found: {' '.join(f.message for f in self.findings[:1])}")
        return found.inverse() if alias.is_inverse else found

    @property
    def _known_names(self) -> list[str]:
        return [name for name, alias in self.aliases.items() if alias.transform in self.calibration.transforms]

    def __getattr__(self, name: str) -> Any:
        """Rotation `R_...` (3, 3) or translation `t_...` (3, 1) [m] of each name."""
        letter, _, alias = name.partition("_")
        if letter not in ("R", "t") or alias not in self.__dict__.get("aliases", {}):
            raise AttributeError(f"a calibration of arrays has no {name!r}")
        return self[alias].mean.rotation if letter == "R" else _column(self[alias])

    def __dir__(self) -> list[str]:
        """List the attributes, including `R_...` and `t_...`."""
        return [*super().__dir__(), *(f"{letter}_{name}" for name in self._known_names for letter in "Rt")]

    def __repr__(self) -> str:
        """Verdict and transforms in one line."""
        transforms = "; ".join(f"{name} {self[name].words()}" for name in self._known_names)
        return f"<{self.verdict}: {transforms or 'no transform'}>"

    def _repr_html_(self) -> str:
        """HTML table for notebooks, with OpenCV's names."""
        calibration = self.calibration
        states = {name: calibration.status.get(self.aliases[name].transform, "free") for name in self._known_names}
        transforms = {name: self[name] for name in states}
        return replace(calibration, transforms=transforms, status=states, findings=self.findings)._repr_html_()


def _column(estimate: PoseEstimate) -> Array:
    return estimate.mean.translation[:, None].copy()
