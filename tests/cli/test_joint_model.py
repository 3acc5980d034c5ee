"""The kinematics that joints are imported for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cyclopts import CycloptsError

from basecal.cli import main
from basecal.cli.joint_model import joint_model, with_offsets
from basecal.errors import InputError
from cell_example import URDF


def test_of_a_urdf_that_comes_along(tmp_path: Path) -> None:
    """The chain, what the cell must have for it, and the file that goes there."""
    path = tmp_path / "hand.urdf"
    path.write_text(URDF)
    chain, entry, files = joint_model(tmp_path / "c", "left", path, "base", "tool0")
    assert len(chain.joint_names) == 2
    assert entry["reference"] == "left"
    assert entry["robots"] == {"left": {"urdf": "hand.urdf", "base_link": "base", "flange_link": "tool0"}}
    assert files == {"hand.urdf": path}


def test_of_the_cell(tmp_path: Path) -> None:
    """What is known is not asked again; where nothing is known it is said what to give."""
    assert main(["simulate", str(tmp_path / "c"), "--samples", "3", "--joints"]) == 0
    chain, entry, files = joint_model(tmp_path / "c", "hand", None, None, None)
    assert (len(chain.joint_names), entry, files) == (6, {}, {})
    with pytest.raises(InputError, match=r"has no URDF of 'arm', .*: give --urdf FILE --base-link"):
        joint_model(tmp_path / "c", "arm", None, None, None)
    with pytest.raises(CycloptsError, match="go together"):
        joint_model(tmp_path / "c", "hand", None, "base", None)


def test_offsets() -> None:
    """A prior of each joint's zero, in radians, beside what the cell must have anyway."""
    assert with_offsets({"a": 1}, "left", None) == {"a": 1}
    entry = with_offsets({"robots": {"left": {"urdf": "x"}}}, "left", 2.0)["robots"]["left"]
    assert entry["urdf"] == "x"
    assert entry["joint_offsets"]["status"] == "prior"
    np.testing.assert_allclose(entry["joint_offsets"]["sigma_rad"], np.radians(2.0), atol=1e-5)
