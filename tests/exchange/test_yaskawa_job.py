"""Tests of positions in Yaskawa jobs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.errors import DatasetError
from basecal.exchange.controller_poses import PoseFormat, read_pose_rows
from basecal.exchange.yaskawa_job import is_job
from basecal.geometry import SE3

JOB = """\
/JOB
//NAME CALIB
//POS
///NPOS 2,0,0,0,0,0
///TOOL 0
///POSTYPE BASE
///RECTAN
///RCONF 0,0,0,0,0,0,0,0
C00000=500.000,100.000,300.000,180.0000,0.0000,0.0000
C00001=520.000,110.000,320.000,170.0000,5.0000,10.0000,0.000
//INST
///DATE 2024/01/01 10:00
NOP
MOVL C00000 V=100.0
SET D000 5
END
"""


def read(folder: Path, text: str, name: str = "yaskawa") -> SE3:
    (folder / "job.jbi").write_text(text, encoding="utf-8")
    return read_pose_rows(str(folder / "job.jbi"), PoseFormat(name)).poses


def test_job_positions_are_read(tmp_path: Path) -> None:
    """Each position is a pose in m, with angles about the fixed axes; external axes and instructions are ignored."""
    assert is_job(JOB)
    assert not is_job("x y z rx ry rz")
    poses = read(tmp_path, JOB)
    np.testing.assert_allclose(poses.translation, [[0.5, 0.1, 0.3], [0.52, 0.11, 0.32]])
    expected = Rotation.from_euler("xyz", [170, 5, 10], degrees=True).as_matrix()
    np.testing.assert_allclose(poses.rotation[1], expected, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "name", "message"),
    [
        (JOB, "fanuc", "job.jbi: is a job of a Yaskawa, not a file of fanuc: give --format yaskawa"),
        (JOB.replace("RECTAN", "PULSE"), "yaskawa", "job.jbi:9: a position in pulses: save it as a relative job"),
        (JOB.replace("C0000", "D0000"), "yaskawa", "job.jbi: a Yaskawa job without positions: expected lines such as"),
        (JOB.replace("520.000", "52O"), "yaskawa", "job.jbi:10: X: '52O' is not a number"),
        (JOB.replace("C00001", "///TOOL 3\nC00001"), "yaskawa", "job.jbi:10: positions of TOOL 0 and 3: save those"),
    ],
)
def test_invalid_job_positions_are_refused(tmp_path: Path, text: str, name: str, message: str) -> None:
    """A job in pulses, of two tools or without positions is refused, and the message states what to do."""
    with pytest.raises(DatasetError) as refused:
        read(tmp_path, text, name)
    assert message in str(refused.value)
