"""Fixture of evidence with only the fields that checks read."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest


def stand_in(**changed):
    """Evidence of a good answer about the base of `hand`, except for the changed fields."""
    usual = {
        "cell": SimpleNamespace(requested_transforms=["base"]),
        "settings": SimpleNamespace(robot_noise="estimated"),
        "recorded": SimpleNamespace(unstated=frozenset(), groups=()),
        "robust": SimpleNamespace(outliers=(), points=100, solution=None),
        "solution": SimpleNamespace(
            converged=True,
            cost=40.0,
            dof=40,
            findings=(),
            noise=SimpleNamespace(estimated=(), robots={}, common={}),
            observability=SimpleNamespace(unobservable=frozenset(), length_m=1.0),
            problem=SimpleNamespace(
                columns={"base": slice(0, 6)}, groups=(), robots=(), stops=SimpleNamespace(robot=())
            ),
            joint_transform_covariance=lambda names: 1e-6 * np.eye(6),
        ),
        "residuals": SimpleNamespace(rms_px=0.3),
        "cross_validation": None,
        "robot_model": None,
        "contradicted_sigmas": (),
        "systematic_error": None,
        "lens_structures": (),
        "images": {},
    }
    return SimpleNamespace(**usual | changed)


@pytest.fixture
def evidence():
    """Factory of evidence, with `solution` changed field by field."""

    def make(solution=None, **changed):
        made = stand_in(**changed)
        for name, value in (solution or {}).items():
            setattr(made.solution, name, value)
        return made

    return make
