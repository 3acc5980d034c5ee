"""The kinematics that joints are imported for: of the cell, or of a URDF that comes with them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from basecal.errors import InputError, UsageError
from basecal.exchange.importing.carriers import known_cell
from basecal.kinematics import SerialChain, read_chain

_WIDEST_DEG = 45.0  # of a joint's offset: beyond this nothing is known of it


@dataclass(frozen=True, eq=False)
class JointModel:
    """The kinematics of a robot whose joints are imported.

    Attributes:
        chain: From its base to its flange.
        entry: What `cell.yaml` must have for it.
        files: Files that go into the cell, by their path there.
    """

    chain: SerialChain
    entry: dict[str, Any]
    files: dict[str, Path] = field(default_factory=dict)


def joint_model(
    folder: str | Path,
    robot: str,
    urdf: str | Path | None,
    base_link: str | None,
    flange_link: str | None,
    offset_sigma_deg: float | None,
) -> JointModel:
    """The kinematics of the cell, or of a URDF that comes with the joints.

    Args:
        folder: The cell, or where one is to be made.
        robot: Its name.
        urdf: Its URDF, if the cell has none.
        base_link: Link of that URDF that the robot stands on.
        flange_link: Link of that URDF that is the flange.
        offset_sigma_deg: Sigma of a prior of each joint's offset [deg]; no prior if None.

    Raises:
        UsageError: if a URDF is given without its links, or links without it, or the sigma is out of range.
        InputError: if none is given, and the cell has none.
    """
    links = (urdf, base_link, flange_link)
    if any(each is not None for each in links) and None in links:
        raise UsageError("--urdf, --base-link and --flange-link go together: give all three")
    if offset_sigma_deg is not None and not 0 < offset_sigma_deg <= _WIDEST_DEG:
        raise UsageError(f"--offset-sigma-deg {offset_sigma_deg:g}: expected more than 0 and at most {_WIDEST_DEG:g}")
    prior = {}
    if offset_sigma_deg is not None:
        prior = {"joint_offsets": {"status": "prior", "sigma_rad": round(math.radians(offset_sigma_deg), 5)}}
    if urdf is None or base_link is None or flange_link is None:
        cell = known_cell(folder)
        known = cell.robots[robot].chain if robot in cell.robots else None
        if known is None:
            give = "give --urdf FILE --base-link LINK --flange-link LINK"
            raise InputError(f"{folder} has no URDF of {robot!r}, which joints need: {give}")
        return JointModel(known, {"robots": {robot: prior}} if prior else {})
    name = Path(urdf).name
    described = {"urdf": name, "base_link": base_link, "flange_link": flange_link, **prior}
    return JointModel(read_chain(urdf, base_link, flange_link), {"robots": {robot: described}}, {name: Path(urdf)})
