"""Export methods of a calibration."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from basecal.cell.cell import Cell
from basecal.methods import METHODS


class Export(Protocol):
    """`basecal.export` of a calibration to a fixed kind."""

    def __call__(
        self,
        transform: str | None = None,
        *,
        robot: str | None = None,
        camera: str | None = None,
        urdf: Sequence[str | Path] = (),
        joint: str | None = None,
        cell: Cell | None = None,
        folder: str | Path | None = None,
        run: str | None = None,
    ) -> str:
        """Return the text of the exported file."""


class Exports:
    """A method for each kind of `basecal export`, such as `to_ur()`."""

    to_ur: Export
    to_kuka: Export
    to_abb: Export
    to_fanuc: Export
    to_yaskawa: Export
    to_staubli: Export
    to_denso: Export
    to_doosan: Export
    to_xarm: Export
    to_ros: Export
    to_ros2: Export
    to_matrix: Export
    to_json: Export
    to_csv: Export
    to_opencv: Export
    to_camera_info: Export
    to_usd: Export
    to_mujoco: Export
    to_urdf: Export
    to_urdf_joint: Export
    to_urdf_cell: Export

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            kind = name.removeprefix("to_")
            if kind == name or kind not in METHODS["export_kinds"]():
                raise AttributeError(f"a calibration has no {name!r}")
            return partial(METHODS["export"], self, kind)

    def __dir__(self) -> Iterable[str]:
        """Return the attributes, including the export methods."""
        return [*super().__dir__(), *Exports.__annotations__]
