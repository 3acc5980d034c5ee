"""Errors that are smooth by place widen the answer of arms that have them, and that of sound arms a little."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.scene.shared_errors import Response, shared_covariance
from basecal.estimation.scene.adjust import SceneFit
from basecal.estimation.scene.fit import fit_scene
from basecal.estimation.scene.spread import scene_covariance
from basecal.geometry import SE3, Array
from scene_points import BASE, made_scene


def sagging(pose: SE3, rad_per_m: float) -> SE3:
    """A recorded pose that does not know that the arm sinks in proportion to its reach."""
    x, y, _ = pose.translation
    turn = rad_per_m * np.array([-y, x, 0.0])
    return SE3.exp(np.r_[np.zeros(3), turn]) @ pose


def fitted(rad_per_m: float) -> SceneFit:
    """Two arms, twelve images each."""
    scene = made_scene(2, arms=2, count=12, points=100)
    poses = SE3.stack([sagging(pose, rad_per_m) for pose in scene.views.base_from_flange])
    views = replace(scene.views, base_from_flange=poses)
    return fit_scene(views, scene.tracks, scene.truth, scene.truth.lenses, (None, None))


def base_covariances(fit: SceneFit) -> tuple[Array, Array]:
    """Of the second base, without and with smooth errors."""
    where = fit.columns.bases[1]
    without = scene_covariance(fit)
    within = without + shared_covariance(fit, 0) + shared_covariance(fit, 1)
    return without[where, where], within[where, where]


def test_arms_that_sag_have_wider_sigmas() -> None:
    """Of 3 mrad a metre the squared Mahalanobis distance of the base is 32 without, and 11 with smooth errors."""
    fit = fitted(3e-3)
    off = (BASE.inverse() @ fit.state.bases[1]).log()
    without, within = (float(off @ np.linalg.solve(each, off)) for each in base_covariances(fit))
    assert without > 25
    assert within < 16


def test_sound_arms_pay_little() -> None:
    """Sigmas of the base grow by 1 to 40 %: data hardly have such errors."""
    without, within = base_covariances(fitted(0.0))
    assert 1.01 < np.sqrt(np.trace(within[:3, :3]) / np.trace(without[:3, :3])) < 1.4


def test_a_response_is_weighed_against_what_is_expected() -> None:
    """One error of which the data know as much as is expected of it is half of what they say, and moves by that."""
    response = Response(np.array([-8.0]), np.array([[4.0]]), np.array([[0.5]]))
    mean, covariance = response.posterior(np.array([0.25]))
    assert mean == pytest.approx([1.0])
    assert covariance == pytest.approx(np.array([[0.125]]))
    assert response.log_evidence(np.array([0.25])) == pytest.approx(0.5 * 8.0 - 0.5 * np.log(2.0))
