"""Tests of the transform between any two frames."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell import Calibration
from basecal.errors import FrameNotFound, InputError
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.geometry import SE3, PoseEstimate
from basecal.simulation import Scenario, simulate

RNG = np.random.default_rng(0)
ORDER = ("r_base_from_a_base", "r_flange_from_camera", "r_base_from_b_base")
ROOT = 1e-3 * RNG.standard_normal((18, 18))
MEANS = [SE3.exp(RNG.standard_normal(6)) for _ in ORDER]
JOINT = ROOT @ ROOT.T
MADE = Calibration(
    "good",
    {
        name: PoseEstimate(m, JOINT[6 * k : 6 * k + 6, 6 * k : 6 * k + 6])
        for k, (name, m) in enumerate(zip(ORDER, MEANS, strict=True))
    },
    order=ORDER,
    joint_covariance=JOINT,
)


def test_base_covariance_includes_shared_error():
    """The covariance between two bases matches 20,000 joint draws of both within a thirtieth of its size."""
    found = MADE.between("a", "b")
    drawn = RNG.standard_normal((20_000, 18)) @ ROOT.T
    a, b = MEANS[0] @ SE3.exp(drawn[:, :6]), MEANS[2] @ SE3.exp(drawn[:, 12:])
    off = (found.mean.inverse() @ a.inverse() @ b).log()
    expected = np.cov(off.T)
    size = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(found.covariance / size / size[:, None], expected / size / size[:, None], atol=0.033)


def test_reference_is_valid_base():
    """From the reference a base is as estimated, to it the inverse; a base from itself is the exact identity."""
    estimate = MADE["r_base_from_a_base"]
    np.testing.assert_allclose(MADE.between("r", "a").covariance, estimate.covariance, atol=1e-15)
    np.testing.assert_allclose(MADE.between("a", "r").covariance, estimate.inverse().covariance, atol=1e-15)
    np.testing.assert_allclose(MADE.between("a", "r").mean.matrix, estimate.inverse().mean.matrix, atol=1e-12)
    same = MADE.between("a", "a")
    np.testing.assert_allclose(same.mean.matrix, np.eye(4), atol=1e-12)
    assert not same.covariance.any()


def test_chain_covariance_includes_shared_error():
    """The covariance of a chain of transforms matches draws.

    The chain has two cameras on one flange and a target seen by one of them, with each transform in either direction.
    """
    order = ("r_flange_from_camera", "r_flange_from_second", "second_from_board")
    means = dict(zip(order, MEANS, strict=True))
    own = {name: JOINT[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] for k, name in enumerate(order)}
    of = {name: PoseEstimate(mean, own[name]) for name, mean in means.items()}
    found = Calibration("good", of, order=order, joint_covariance=JOINT).frame_between("board", "camera")
    drawn = RNG.standard_normal((20_000, 18)) @ ROOT.T
    camera, second, board = (means[name] @ SE3.exp(drawn[:, 6 * k : 6 * k + 6]) for k, name in enumerate(order))
    off = (found.mean.inverse() @ board.inverse() @ second.inverse() @ camera).log()
    expected = np.cov(off.T)
    size = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(found.covariance / size / size[:, None], expected / size / size[:, None], atol=0.033)


def test_fixed_base_adds_no_covariance():
    """A stated base has no row in the joint covariance and adds no uncertainty."""
    fixed = Calibration("good", {ORDER[0]: PoseEstimate.exact(MEANS[0]), ORDER[2]: MADE[ORDER[2]]}, order=ORDER[2:])
    alone = Calibration("good", fixed.transforms, order=ORDER[2:], joint_covariance=JOINT[12:, 12:])
    np.testing.assert_allclose(alone.between("a", "b").covariance, JOINT[12:, 12:], atol=1e-15)
    assert not fixed.between("a", "b").covariance.any()


def test_unknown_robot_lists_known_robots():
    """The error for an unknown robot lists the known ones; a camera is no robot."""
    with pytest.raises(FrameNotFound, match=r"no 'camera'.*a, b, r"):
        MADE.between("a", "camera")


@pytest.mark.slow
def test_nees_of_base_to_base_is_six():
    """The mean NEES between two non-reference robots of a ring of five is 6 within four sigmas over 60 cells.

    If their bases were treated as independent it would be far less, because both share errors.
    """
    scenario = Scenario(layout="ring", robots=5, samples=80, robot_noise=(1e-4, 2e-4))
    together, apart = [], []
    for seed in range(60):
        made = simulate(scenario, seed)
        solution = solve(made.cell, made.recording, Settings(robot_noise="stated"))
        order = tuple(name for name in solution.transforms if name in solution.problem.columns)
        covariance = solution.joint_transform_covariance(list(order))
        found = Calibration("good", solution.transforms, order=order, joint_covariance=covariance)
        bases = [f"r1_base_from_{name}_base" for name in ("r3", "r4")]
        truth = made.truth[bases[0]].inverse() @ made.truth[bases[1]]
        estimate = found.between("r3", "r4")
        off = (estimate.mean.inverse() @ truth).log()
        together.append(off @ np.linalg.solve(estimate.covariance, off))
        alone = found[bases[0]].inverse() @ found[bases[1]]
        apart.append(off @ np.linalg.solve(alone.covariance, off))
    assert abs(np.mean(together) - 6) < 4 * np.sqrt(12 / 60)
    assert np.mean(apart) < 6 - 4 * np.sqrt(12 / 60)


def test_unconnected_frames_are_refused():
    """The error for an unknown frame lists the known ones.

    For two frames that move relative to each other it lists those rigidly connected to the first.
    """
    of = {
        name: PoseEstimate.exact(SE3.identity())
        for name in ("eye_base_from_hand_base", "eye_flange_from_wrist", "eye_flange_from_lamp")
    }
    made = Calibration("good", of)
    with pytest.raises(FrameNotFound, match=r"no 'wirst'.*eye_base, hand_base, eye_flange, wrist, lamp"):
        made.frame_between("lamp", "wirst")
    with pytest.raises(InputError) as caught:
        made.frame_between("wrist", "hand_base")
    assert str(caught.value) == (
        "'wrist' and 'hand_base' are not rigidly connected by known transforms. "
        "Frames rigidly connected to 'wrist': eye_flange, lamp"
    )
