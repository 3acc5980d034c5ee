"""Which targets and cameras are mere points, whose mounts have a place and no rotation."""

from __future__ import annotations

from collections.abc import Sequence

from basecal.cell import Cell
from basecal.errors import InputError
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.contacts import GRIPS
from basecal.estimation.view.points import is_touch
from basecal.estimation.view.poses import PoseMeasurement


def point_mounts(cell: Cell, groups: Sequence[ViewGroup]) -> frozenset[str]:
    """Names of the mounts of single points, but of those that were measured as poses: their orientation counts.

    Raises:
        InputError: if a point that was measured as poses is seen as a point, too, or its mount is stated, which has no
            rotation then.
    """
    points = {t.name for t in cell.targets.values() if t.target is not None and t.target.is_point}
    posed = {g.target for g in groups if isinstance(g.measurement, PoseMeasurement)} & points
    seen = {g.target for g in groups if not isinstance(g.measurement, PoseMeasurement)}
    for target in sorted(posed):
        if target in seen or cell.targets[target].mount.status != "free":
            raise InputError(
                f"target {target!r} is one point, which has no orientation, and is observed by `camera_from_target`. "
                "Leave out its `kind` and state its mount with a rotation. Views of the point itself are of another "
                "target"
            )
    return frozenset(map(cell.mount_name, (points - posed) | _tips(groups)))


def _tips(groups: Sequence[ViewGroup]) -> set[str]:
    """Tips that see points at their own origin only: no rotation of such a mount matters."""
    return {g.camera for g in groups} - {
        g.camera for g in groups if not is_touch(g.measurement) or isinstance(g.measurement, tuple(GRIPS.values()))
    }
