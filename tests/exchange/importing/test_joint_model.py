"""The kinematics that joints are imported for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.cli import main
from basecal.errors import InputError, UsageError
from basecal.exchange.importing.joint_model import joint_model
from cell_example import URDF


def test_of_a_urdf_that_comes_along(tmp_path: Path) -> None:
    """The chain, what the cell must have for it, and the file that goes there."""
    path = tmp_path / "hand.urdf"
    path.write_text(URDF)
    model = joint_model(tmp_path / "c", "left", path, "base", "tool0", None)
    assert len(model.chain.joint_names) == 2
    links = {"urdf": "hand.urdf", "base_link": "base", "flange_link": "tool0"}
    assert model.entry == {"robots": {"left": links}}
    assert model.files == {"hand.urdf": path}


def test_of_the_cell(tmp_path: Path) -> None:
    """What is known is not asked again; where nothing is known it is said what to give."""
    assert main(["simulate", str(tmp_path / "c"), "--samples", "3", "--joints"]) == 0
    model = joint_model(tmp_path / "c", "hand", None, None, None, None)
    assert (len(model.chain.joint_names), model.entry, model.files) == (6, {}, {})
    with pytest.raises(InputError, match=r"has no URDF of 'arm', .*: give --urdf FILE --base-link"):
        joint_model(tmp_path / "c", "arm", None, None, None, None)
    with pytest.raises(UsageError, match="go together"):
        joint_model(tmp_path / "c", "hand", None, "base", None, None)


def test_offsets(tmp_path: Path) -> None:
    """A prior of each joint's zero, in radians, beside what the cell must have anyway."""
    path = tmp_path / "hand.urdf"
    path.write_text(URDF)
    entry = joint_model(tmp_path / "c", "left", path, "base", "tool0", 2.0).entry["robots"]["left"]
    assert entry["urdf"] == "hand.urdf"
    assert entry["joint_offsets"]["status"] == "prior"
    np.testing.assert_allclose(entry["joint_offsets"]["sigma_rad"], np.radians(2.0), atol=1e-5)
    for sigma in (0.0, 46.0, float("nan")):
        with pytest.raises(UsageError, match="expected more than 0 and at most 45"):
            joint_model(tmp_path / "c", "left", path, "base", "tool0", sigma)
