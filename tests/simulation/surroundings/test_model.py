"""The cell as MuJoCo reads it."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from basecal.cell.targets.all_kinds import target_kind
from basecal.cell.targets.led import led_target
from basecal.registry import TargetKindName
from basecal.simulation.running.ur5e import ur5e
from basecal.simulation.surroundings.model import TABLE, TABLE_M, Stage, body_names, mjcf

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'basecal[sim]'")


def stage(target):
    return Stage({"eye": ur5e(), "hand": ur5e()}, {"eye": np.zeros(3), "hand": np.array([1.7, 0, 0])}, target, 0)


@pytest.mark.parametrize("kind", get_args(TargetKindName))
def test_every_target_is_read(kind):
    """MuJoCo takes the model, whose bodies are all put somewhere from outside."""
    of = stage(target_kind(kind).usual(np.random.default_rng(0)))
    model = mujoco.MjModel.from_xml_string(mjcf(of, (64, 48), 40.0))
    assert model.nmocap == len(body_names(of)) + 1
    assert {model.body(k).name for k in range(1, model.nbody)} == {*body_names(of), "eye"}


def test_the_table_is_as_high_as_is_said():
    """Its top is where a light is mirrored."""
    model = mujoco.MjModel.from_xml_string(mjcf(stage(led_target()), (64, 48), 40.0))
    table = model.geom(TABLE)
    assert table.pos[2] + table.size[2] == pytest.approx(TABLE_M)
    assert np.all(np.abs(table.pos[0] - np.array([0, 1.7])) < table.size[0])


def test_another_seed_is_other_clutter():
    """And nothing else."""
    one, other = (mjcf(Stage({}, {"eye": np.zeros(3)}, led_target(), seed), (64, 48), 40.0) for seed in (0, 1))
    different = [(a, b) for a, b in zip(one.splitlines(), other.splitlines(), strict=True) if a != b]
    assert len(different) == 1
