"""What is known beforehand of a scene's unknowns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import Intrinsics, Unknown
from basecal.estimation.scene.priors import prior_information
from basecal.estimation.scene.state import scene_columns, take_step
from basecal.geometry import SE3
from scene_points import LENS, MOUNT, made_scene


def test_gradients_are_differences_of_costs():
    """Of a mount with a prior, a stated lens, a free lens and errors of stops."""
    scene = made_scene(1, arms=2, count=3)
    known = Unknown("prior", MOUNT, np.full(6, 0.01))
    stated = Intrinsics("prior", LENS, np.full(9, 0.5))
    first = replace(scene.views.cameras[0], mount=known, lens=stated)
    views = replace(scene.views, cameras=(first, scene.views.cameras[1]))
    sigmas = np.full((6, 6), 1e-3)
    columns = scene_columns(views, scene.truth.lenses)
    rng = np.random.default_rng(0)
    state = take_step(scene.truth, columns, rng.normal(0, 1e-3, columns.errors.stop))
    about = prior_information(views, state, columns, sigmas, (LENS, LENS))
    for _ in range(5):
        step = rng.normal(0, 1e-7, columns.errors.stop)
        ahead, behind = (
            prior_information(views, take_step(state, columns, sign * step), columns, sigmas, (LENS, LENS)).cost
            for sign in (1, -1)
        )
        assert ahead - behind == pytest.approx(4 * about.gradient @ step, rel=1e-3, abs=1e-9)


def test_a_prior_at_its_middle_costs_nothing():
    """The state that is expected has no gradient, and one sigma of a mount costs one."""
    scene = made_scene(2, count=3)
    first = replace(scene.views.cameras[0], mount=Unknown("prior", MOUNT, np.full(6, 0.01)))
    views = replace(scene.views, cameras=(replace(first, lens=Intrinsics("prior", LENS, np.full(9, 0.5))),))
    columns = scene_columns(views, scene.truth.lenses)
    sigmas = np.full((3, 6), 1e-3)
    about = prior_information(views, scene.truth, columns, sigmas, (LENS,))
    assert about.cost == pytest.approx(0.0, abs=1e-12)
    off = replace(scene.truth, mounts=SE3.stack([MOUNT @ SE3.exp([0.01, 0, 0, 0, 0, 0])]))
    assert prior_information(views, off, columns, sigmas, (LENS,)).cost == pytest.approx(1.0)
