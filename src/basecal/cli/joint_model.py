"""The kinematics that joints are imported for: of the cell, or of a URDF that comes with them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import CycloptsError, Parameter, validators

from basecal.cli.imported import robot_entry
from basecal.errors import InputError

if TYPE_CHECKING:
    from basecal.kinematics import SerialChain

_WIDEST_DEG = 45.0  # of a joint's offset: beyond this nothing is known of it
SigmaDeg = Annotated[float, Parameter(validator=validators.Number(gt=0, lte=_WIDEST_DEG))]
"""How far the zero of a joint may be off, one sigma [deg]."""


def joint_model(
    cell: Path, robot: str, urdf: Path | None, base_link: str | None, flange_link: str | None
) -> tuple[SerialChain, dict[str, Any], dict[str, Path]]:
    """The chain, what `cell.yaml` must have for it, and files that go into the cell by their path there.

    Raises:
        CycloptsError: if a URDF is given without its links, or links without it.
        InputError: if none is given, and the cell has none.
    """
    from basecal.cell.files import read_cell

    links = (urdf, base_link, flange_link)
    if any(each is not None for each in links) and None in links:
        raise CycloptsError(msg="--urdf, --base-link and --flange-link go together: give all three")
    if urdf is None or base_link is None or flange_link is None:
        robots = read_cell(cell).robots if (cell / "cell.yaml").exists() else {}
        known = robots[robot].chain if robot in robots else None
        if known is None:
            give = "give --urdf FILE --base-link LINK --flange-link LINK"
            raise InputError(f"{cell} has no URDF of {robot!r}, which joints need: {give}")
        return known, {}, {}
    from basecal.kinematics import read_chain

    chain = read_chain(urdf, base_link, flange_link)
    entry = robot_entry(cell, robot)
    entry["robots"] = {robot: {"urdf": urdf.name, "base_link": base_link, "flange_link": flange_link}}
    return chain, entry, {urdf.name: urdf}


def with_offsets(entry: dict[str, Any], robot: str, sigma_deg: float | None) -> dict[str, Any]:
    """What `cell.yaml` must have, with a prior of that sigma [deg] of each joint's offset; as it was where None."""
    if sigma_deg is None:
        return entry
    offsets = {"status": "prior", "sigma_rad": round(math.radians(sigma_deg), 5)}
    described = entry.get("robots", {}).get(robot, {})
    return {**entry, "robots": {robot: {**described, "joint_offsets": offsets}}}
