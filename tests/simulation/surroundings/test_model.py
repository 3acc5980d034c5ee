"""The cell as MuJoCo reads it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell.targets.led import led_target
from basecal.cell.targets.registry import TARGETS
from basecal.simulation.running.ur5e import ur5e
from basecal.simulation.surroundings.model import TRAY, Stage, body_names, mjcf

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'basecal[sim]'")


def stage(target):
    return Stage({"eye": ur5e(), "hand": ur5e()}, {"eye": np.zeros(3), "hand": np.array([1.7, 0, 0])}, target, 0)


@pytest.mark.parametrize("kind", TARGETS)
def test_every_target_is_read(kind):
    """MuJoCo takes the model, whose bodies are all put somewhere from outside."""
    of = stage(TARGETS[kind].usual(np.random.default_rng(0)))
    model = mujoco.MjModel.from_xml_string(mjcf(of, (64, 48), 40.0))
    assert model.nmocap == len(body_names(of)) + 1
    assert {model.body(k).name for k in range(1, model.nbody)} == {*body_names(of), "eye"}


def test_the_tray_is_where_it_is_said():
    """Its top is where a light is mirrored; without one there is none."""
    tray = np.array([0.8, 0.1, 0.4])
    plain = stage(led_target())
    model = mujoco.MjModel.from_xml_string(mjcf(replace(plain, tray=tray), (64, 48), 40.0))
    under = np.array([0, 0, model.geom(TRAY).size[2]])
    assert model.geom(TRAY).pos + under == pytest.approx(tray)
    assert TRAY not in mjcf(plain, (64, 48), 40.0)


def test_another_seed_is_other_clutter():
    """And nothing else."""
    one, other = (mjcf(Stage({}, {"eye": np.zeros(3)}, led_target(), seed), (64, 48), 40.0) for seed in (0, 1))
    different = [(a, b) for a, b in zip(one.splitlines(), other.splitlines(), strict=True) if a != b]
    assert len(different) == 1
