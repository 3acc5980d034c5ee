"""Tests of a running cell in its folder."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.files import read_cell, read_truth
from basecal.cell.results.truth_file import read_truth_extra
from basecal.errors import DatasetError
from basecal.simulation.running.faults import FAULTS, read_faults
from basecal.simulation.running.plant import Clock, Plant
from basecal.simulation.running.world_file import read_world, write_world, write_world_truth
from shared.facing_arms import facing_arms


def test_world_is_read_as_written(tmp_path):
    """Truth, arms and home joints are read to the last bit, and the cell names its drivers."""
    world = facing_arms(seed=4)
    write_world(world, tmp_path)
    again = read_world(tmp_path)
    for name, true in world.truth.items():
        np.testing.assert_allclose(again.truth[name].matrix, true.matrix, atol=1e-14)
    assert all(np.array_equal(again.home[name], joints) for name, joints in world.home.items())
    assert again.seed == 4
    assert read_cell(tmp_path).cameras["wrist"].driver.kind == "simulated"


@pytest.mark.parametrize("name", list(FAULTS))
def test_each_fault_is_written_to_the_truth(tmp_path, name):
    """The file has the size and unit of the fault.

    It also has the later pose of a displaced object, and the parameters of erroneous arms.
    """
    world = facing_arms(faults=read_faults([name]))
    write_world(world, tmp_path)
    written = read_truth_extra(tmp_path)
    kind = FAULTS[name]
    assert written["faults"] == [
        {
            "name": name,
            "size": pytest.approx(kind.default_size),
            "unit": kind.unit,
            **({"after_moves": 12} if kind.is_sudden else {}),
        }
    ]
    assert set(written.get("transforms_afterwards", {})) == set(world.pushed)
    assert bool(world.pushed) == kind.is_sudden
    for robot, parameters in written.get("robot_parameters", {}).items():
        for of, values in parameters.items():
            assert np.array_equal(values, world.robots[robot].values[of])
    read_truth(tmp_path)


def test_mjcf_arm_equals_urdf_arm(tmp_path):
    """A cell with an MJCF in place of its arm's URDF gives the same image."""
    pytest.importorskip("mujoco", reason="pip install 'basecal[sim]'")
    world = facing_arms(seed=2)
    write_world(world, tmp_path)
    before = Plant(read_world(tmp_path), Clock(0)).shot("wrist").image
    chain = world.cell.robots["hand"].chain
    (tmp_path / "hand.urdf").unlink()
    (tmp_path / "hand.xml").write_text(_mjcf(chain, "base_link", "tool0"), encoding="utf-8")
    text = (tmp_path / "cell.yaml").read_text(encoding="utf-8")
    (tmp_path / "cell.yaml").write_text(text.replace("hand.urdf", "hand.xml"), encoding="utf-8")
    again = read_world(tmp_path)
    np.testing.assert_allclose(again.cell.robots["hand"].chain.upper, chain.upper)
    after = Plant(again, Clock(0)).shot("wrist").image
    # Positions differ by rounding, which changes one level in a thousand.
    assert np.mean(before != after) < 1e-3


def _mjcf(chain, base, flange):
    """MJCF of a chain, with a body for each joint."""
    bodies = [f'<body name="{base}">']
    for k, name in enumerate(chain.joint_names):
        low, high = chain.lower[k], chain.upper[k]
        joint = f'<joint name="{name}" axis="{_text(chain.axes[k])}" range="{_text((low, high))}"/>'
        centre, kg = _text(chain.masses.centres[k]), _text(chain.masses.kg[k : k + 1])
        mass = f'<inertial pos="{centre}" mass="{kg}" diaginertia="1 1 1"/>'
        bodies.append(f'<body name="link_{k}" {_place(chain.origins[k])}>{mass}{joint}')
    ends = "</body>" * len(bodies)
    site = f'<site name="{flange}" {_place(chain.tip)}/>'
    return f"""<mujoco><compiler angle="radian"/><worldbody>{"".join(bodies)}{site}{ends}</worldbody></mujoco>"""


def _place(pose):
    return f'pos="{_text(pose.translation)}" quat="{_text(np.roll(pose.quaternion, 1))}"'


def _text(numbers):
    return " ".join(repr(float(value)) for value in numbers)


def test_faults_are_drawn_for_each_run(tmp_path):
    """A cell that runs again with another fault is the same cell, and its truth has the new fault."""
    write_world(facing_arms(faults=read_faults(["sag"])), tmp_path)
    world = read_world(tmp_path, read_faults(["joint-offsets"]))
    write_world_truth(world, tmp_path)
    assert [fault["name"] for fault in read_truth_extra(tmp_path)["faults"]] == ["joint-offsets"]
    assert set(read_truth_extra(tmp_path)["robot_parameters"]["eye"]) == {"joint_offsets"}


def test_cell_without_run_data_is_refused(tmp_path):
    """A cell without a truth, or whose truth lacks home joints, is refused with what is missing."""
    write_world(facing_arms(), tmp_path)
    path = tmp_path / "truth.yaml"
    path.write_text(path.read_text().replace("running:", "jogging:"))
    with pytest.raises(DatasetError, match=r"truth\.yaml: running\.home_joints_rad: this cell has no data to run"):
        read_world(tmp_path)
    path.unlink()
    with pytest.raises(DatasetError, match="only simulated cells have a truth"):
        read_world(tmp_path)
