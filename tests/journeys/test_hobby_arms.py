"""Journey: two hobby arms with LeRobot, joints in degrees with offsets, and a webcam."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from basecal.cell.files import latest_run, read_calibration
from basecal.exchange.urdf import chain_urdf
from basecal.geometry import SE3
from basecal.simulation import SimulatedCell
from tests.journeys.raw import (
    BOARD_OPTIONS,
    THREE_SIGMAS,
    cell,
    is_pasted,
    is_within_three_sigmas,
    photographs,
    run,
)

pytestmark = pytest.mark.slow
pyarrow = pytest.importorskip("pyarrow", reason="LeRobot's datasets are parquet, by the extra lerobot")
NAME = "leader_base_from_follower_base"
OFFSET_DEG = 2.0
RATE_HZ = 10
STOP, MOTION = 10, 5  # frames
STEP_DEG = 360 / 4096  # of the magnetic encoders in the servos of such arms
LINKS = "--base-link base_link --flange-link tool0"


def dataset(made: SimulatedCell, robot: str, folder: Path) -> None:
    """Episode in the layout of LeRobot v2.1: `observation.state` in degrees with the gripper last; stops and motions.

    Source: huggingface/lerobot, docs of LeRobotDataset v2.1.
    """
    from pyarrow import parquet

    chain = made.cell.robots[robot].chain
    assert chain is not None
    names = [*(f"{joint}.pos" for joint in chain.joint_names), "gripper.pos"]
    (folder / "meta").mkdir(parents=True)
    state = {"dtype": "float32", "shape": [len(names)], "names": names}
    info = {"codebase_version": "v2.1", "fps": RATE_HZ, "features": {"observation.state": state}}
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    stops = np.degrees([sample.robots[robot].joints_rad for sample in made.recording.samples])  # type: ignore[arg-type]
    shares = np.concatenate([np.zeros(STOP), np.arange(1, MOTION + 1) / (MOTION + 1)])[:, None]
    moved = [stop + shares * (after - stop) for stop, after in zip(stops, [*stops[1:], stops[-1]], strict=True)]
    degrees = np.column_stack(
        [STEP_DEG * np.round(np.concatenate(moved) / STEP_DEG), np.full(len(stops) * len(shares), 12.5)]
    )
    rows = [
        {"observation.state": row.tolist(), "timestamp": i / RATE_HZ, "frame_index": i, "episode_index": 0}
        for i, row in enumerate(degrees)
    ]
    path = folder / "data" / "chunk-000" / "episode_000000.parquet"
    path.parent.mkdir(parents=True)
    types = {"observation.state": pyarrow.list_(pyarrow.float32()), "timestamp": pyarrow.float32()}
    schema = pyarrow.schema([*types.items(), ("frame_index", pyarrow.int64()), ("episode_index", pyarrow.int64())])
    parquet.write_table(pyarrow.Table.from_pylist(rows, schema), path)
    (folder.parent / f"{folder.name}.urdf").write_text(chain_urdf(chain, "base_link", "tool0", folder.name))


def frame_name(i: int) -> str:
    """File of the frame in the middle of a stop, named by its time in the episode [s]."""
    return f"{(i * (STOP + MOTION) + STOP // 2) / RATE_HZ:.3f}.png"


def are_offsets_within_three_sigmas(made: SimulatedCell, place: Path) -> bool:
    """Whether all observable offsets are within three sigmas of the truth, for that many numbers."""
    run_folder = latest_run(place)
    assert run_folder is not None
    calibration = read_calibration(run_folder)
    squares, count = 0.0, 0
    for robot, name in (("eye", "leader"), ("hand", "follower")):
        found = calibration.parameters_of_robot(name)["joint_offsets"]
        assert found.covariance is not None
        off = (found.values - made.robots[robot].kind_values("joint_offsets"))[found.seen]
        squares += float(off @ np.linalg.solve(found.covariance[np.ix_(found.seen, found.seen)], off))
        count += len(off)
    return bool(count > 4 and squares < chi2.isf(THREE_SIGMAS, count))


def test_from_episodes_to_a_matrix(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Joint offsets of degrees are estimated with the base; the answer is a matrix for a Python program."""
    monkeypatch.chdir(tmp_path)
    made = cell(samples=40, seed=1, joints=True, joint_offset_rad=np.radians(OFFSET_DEG), robot_noise=(0.0, 0.0))
    photographs(made, tmp_path, frame_name)
    for robot, name in (("eye", "leader"), ("hand", "follower")):
        dataset(made, robot, tmp_path / name)
    board = f"{BOARD_OPTIONS} --target-on follower"
    offsets = f"--unit deg {LINKS} --offset-sigma-deg {OFFSET_DEG:g}"
    run(
        f"basecal import images mycell photos --camera webcam --on leader --by time {board}",
        f"basecal import lerobot mycell leader --robot leader --urdf leader.urdf {offsets}",
        f"basecal import lerobot mycell follower --robot follower --urdf follower.urdf {offsets}",
        "basecal calibrate mycell",
        "basecal export mycell --to matrix -o base.txt",
    )
    printed = capsys.readouterr().out
    assert "GOOD: expected error " in printed
    assert f"\n{NAME} to " in printed
    place = tmp_path / "mycell"
    assert is_within_three_sigmas(place, NAME, made.truth["eye_base_from_hand_base"])
    matrix = np.loadtxt(tmp_path / "base.txt")
    assert is_pasted(SE3(matrix[:3, :3], matrix[:3, 3]), place, NAME)
    assert are_offsets_within_three_sigmas(made, place)
