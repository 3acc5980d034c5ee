"""Tests of `join_scene`: tracks of the static scene beside a board, in one solution."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.sample_use import SampleUse, sample_use
from basecal.accuracy.scene import join_scene as room
from basecal.accuracy.scene.images import read_images
from basecal.accuracy.scene.join_scene import _place_in_world, _predicts_better, _update_images, join_scene
from basecal.cell import Calibration, Cell, Finding, Recording, RobotState, Sample
from basecal.cell.files import read_cell, read_recording
from basecal.estimation.problem.problem import State
from basecal.estimation.scene.state import SceneState
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from scene_points import ARM_M, ARM_RAD, BASE, LENS, Scene, made_scene
from scene_tracks import write_tracks

BASE_NAME = "left_base_from_right_base"
BOARD_MOUNT = SE3.from_rpy((0.1, 0.2, 0.3), (0.02, 0.01, 0.1))
NOISE = np.repeat([ARM_M, ARM_RAD], 3)


def board_beside_tracks(folder: Path, scene: Scene, seed: int, boards: int) -> tuple[Cell, Recording]:
    """A board on the right arm, which the left eye sees in its first views, beside the tracks of a scene.

    Args:
        folder: Of the cell.
        scene: Of two arms.
        seed: Of what is drawn.
        boards: How many views show it.
    """
    write_tracks(folder, scene)
    cell = json.loads((folder / "cell.yaml").read_text())
    cell["targets"] = {"board": {"on": "right", "kind": "chessboard", "corners": [7, 5], "square_m": 0.03}}
    (folder / "cell.yaml").write_text(json.dumps(cell))
    target = read_cell(folder).targets["board"].target
    assert target is not None
    rng = np.random.default_rng(seed)
    path = folder / "recording" / "samples.jsonl"
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    for view in range(boards):
        while True:
            rotvec = np.array([np.pi, 0, 0]) + rng.uniform(-0.5, 0.5, 3)
            at = SE3.from_rpy(rotvec, (*rng.uniform(-0.1, 0.1, 2), rng.uniform(0.4, 0.7)))
            if LENS.sees(at @ target.points).all():
                break
        pixels = LENS.project(at @ target.points) + 0.2 * rng.standard_normal((len(target.points), 2))
        right = (
            BASE.inverse()
            @ scene.world_from_camera[view]
            @ at
            @ BOARD_MOUNT.inverse()
            @ SE3.exp(rng.standard_normal(6) * NOISE)
        )
        pose = {"t_m": right.translation.tolist(), "q_xyzw": right.quaternion.tolist()}
        lines[view]["robots"]["right"] = {"base_from_flange": pose}
        seen = {"camera": "left_eye", "target": "board", "ids": target.ids.tolist(), "pixels": pixels.tolist()}
        lines[view]["observations"].append(seen)
    path.write_text("\n".join(map(json.dumps, lines)) + "\n")
    described = read_cell(folder)
    return described, read_recording(folder, described)


def off_base(answer: Calibration) -> tuple[float, float, float]:
    """Distance of the base from the truth [m], its square by the covariance, and the sigma [m]."""
    base = answer.transforms[BASE_NAME]
    off = (BASE.inverse() @ base.mean).log()
    m2 = float(off @ np.linalg.solve(base.covariance, off))
    return float(np.linalg.norm(off[:3])), m2, float(np.sqrt(np.trace(base.covariance[:3, :3])))


@pytest.mark.slow
def test_scene_and_board_give_one_answer(tmp_path: Path) -> None:
    """The base is good, within its 99.99 % ellipsoid, and its sigma is below three quarters of the board's alone."""
    scene = made_scene(1, arms=2, count=12, points=220)
    cell, recording = board_beside_tracks(tmp_path, scene, 1, boards=12)
    no_target = Finding("few-images", "warning", ("right_eye",), "12 of 12 images show no target.")
    recording = replace(recording, findings=(no_target,))
    without = replace(recording, samples=tuple(replace(each, tracks=()) for each in recording.samples))
    both, board = calibrate(cell, recording), calibrate(cell, without)
    assert both.verdict == "good"
    assert [each.code for each in both.findings] == ["scene-joined"]
    assert off_base(both)[1] < 27.9
    assert off_base(both)[2] < 0.75 * off_base(board)[2]
    assert "right_flange_from_right_eye" in both.transforms
    assert no_target in board.findings
    assert sample_use(recording, both) == SampleUse(used=24, recorded=24, views=36)
    assert sample_use(recording, board).used == 12


def shift_world(recording: Recording, shift: SE3) -> Recording:
    """The recording as if the world had moved before the right eye looked."""

    def moved(sample: Sample) -> Sample:
        """A sample of the right eye with the pose that gives the same view of the moved world."""
        pose = sample.robots["right"].base_from_flange
        assert pose is not None
        return replace(sample, robots={"right": RobotState(BASE.inverse() @ shift @ BASE @ pose)})

    own = (moved(each) if each.tracks[0].camera == "right_eye" else each for each in recording.samples)
    return replace(recording, samples=tuple(own))


@pytest.mark.slow
def test_scene_contradicting_board_is_left_out(tmp_path: Path) -> None:
    """A scene that contradicts the board is left out with a warning, and the answer is unchanged.

    The right arm's part moved by 5 cm before it looked.
    """
    scene = made_scene(1, arms=2, count=12, points=220)
    cell, recording = board_beside_tracks(tmp_path, scene, 1, boards=12)
    away = shift_world(recording, SE3.exp(np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.0])))
    solution = solve(cell, away, Settings())
    found, (finding,), _ = join_scene(cell, away, solution, Settings(), ())
    assert found is solution
    assert (finding.code, finding.severity, finding.about) == ("scene-rival", "warning", (BASE_NAME,))


@pytest.mark.slow
def test_scene_of_few_images_is_left_out(tmp_path: Path) -> None:
    """A scene of nine images and three outliers is left out with the reason, and the board's answer is unchanged."""
    scene = made_scene(1, arms=2, count=12, points=220)
    cell, recording = board_beside_tracks(tmp_path, scene, 1, boards=12)
    solution = solve(cell, recording, Settings())
    found, (finding,), kept = join_scene(cell, recording, solution, Settings(), {0, 1, 2})
    assert found is solution
    assert kept is None
    assert (finding.code, finding.severity) == ("scene-left-out", "info")
    assert "9 images of left_eye" in finding.what


def test_world_of_scene_is_base_of_one_robot(tmp_path: Path) -> None:
    """The world of the scene is the base of one robot; other bases are free, whatever the board determines.

    Both answers are compared.
    """
    cell, recording = board_beside_tracks(tmp_path, made_scene(1, arms=2, count=6, points=60), 1, boards=6)
    images = read_images(cell, recording, Settings())
    solution = solve(cell, recording, Settings(robot_noise="stated"))
    for anchor, statuses in (("left", ["fixed", "free"]), ("right", ["free", "fixed"])):
        placed = _update_images(images, solution, cell, anchor)
        assert placed.views.robots == ("left", "right")
        assert [base.status for base in placed.views.bases] == statuses
    left, right = (f"{name}_flange_from_{name}_eye" for name in ("left", "right"))
    state = SimpleNamespace(cameras={"left_eye": "lens"}, transforms={left: "mount", right: "open"})
    known = SimpleNamespace(state=state, observability=SimpleNamespace(unobservable={right}))
    for guessed, left_guessed in ((True, (False, True)), (False, (False, False))):
        placed = _update_images(replace(images, is_guessed=(guessed, guessed)), known, cell, "left")
        assert placed.is_guessed == left_guessed
        assert placed.lenses == ("lens", images.lenses[1])
        assert placed.mounts == ("mount", None)


def test_missing_images_leave_answer_unchanged(tmp_path: Path) -> None:
    """Without images the answer is unchanged, and the finding names the missing images."""
    cell, recording = board_beside_tracks(tmp_path, made_scene(1, arms=2, count=6, points=60), 1, boards=6)
    bare = replace(recording, samples=tuple(replace(each, tracks=()) for each in recording.samples))
    solution = solve(cell, bare, Settings(robot_noise="stated"))
    found, (finding,), _ = join_scene(cell, bare, solution, Settings(), ())
    assert found is solution
    assert "No camera has images" in finding.what


@pytest.mark.parametrize(
    ("severity", "few", "better", "outcome"),
    [
        ("error", False, True, ["rival"]),
        ("error", True, False, ["rival"]),
        ("info", False, False, ["few", "rival", "points"]),
        (None, True, True, ["scene-left-out"]),
        (None, False, False, ["scene-left-out"]),
        (None, False, True, ["report", "points"]),
    ],
)
def test_scene_must_agree_and_predict(monkeypatch, severity, few, better, outcome) -> None:
    """A scene is used if it does not contradict a base and, without a base finding, predicts held-out views."""
    found = [] if severity is None else [Finding("rival", severity, (), "They disagree.")]
    fit = SimpleNamespace()

    def find(images, stated, anchor, report, settings):
        code = "few-images" if few else "few" if severity else "report"
        report.findings = [Finding(code, "info", (), "Few images.")]
        return fit

    joined = SimpleNamespace(problem=SimpleNamespace(tied=SimpleNamespace(points="points")))
    views = SimpleNamespace(robots=("right", "left"))
    for name, value in {
        "read_images": lambda *given: SimpleNamespace(views=views),
        "find_scene": find,
        "_noise": lambda solution, robot: robot,
        "_update_images": lambda images, solution, cell, anchor: images,
        "_place_in_world": lambda fit, world_from_base: fit,
        "_base_findings": lambda *given: iter(found),
        "_solve_jointly": lambda *given: joined,
        "_predicts_better": lambda solution, iterations: better,
        "scene_fingerprint": lambda images, fit, points: f"kept {points}",
        "points_finding": lambda fit: Finding("points", "info", (), ""),
    }.items():
        monkeypatch.setattr(room, name, value)
    cell = SimpleNamespace(reference="left", base_name=lambda robot: f"left_base_from_{robot}_base")
    solution = SimpleNamespace(state=SimpleNamespace(transforms={}))
    answer, findings, kept = join_scene(cell, Recording(), solution, Settings(), ())
    assert [each.code for each in findings] == outcome
    is_used = outcome[-1] == "points"
    assert answer is (joined if is_used else solution)
    assert kept == ("kept points" if is_used else None)
    if severity == "error":
        assert findings[0].severity == "warning"
    if outcome == ["scene-left-out"]:
        assert ("Few images" in findings[0].what) == few


@pytest.mark.parametrize(("gain", "is_better"), [(0.1, True), (0.0, False), (-0.1, False)])
def test_scene_predicts_better_if_scores_decrease(monkeypatch, gain, is_better) -> None:
    """A scene is used if it decreases held-out scores, or if no sample can be held out."""
    solution = SimpleNamespace(problem=Tied("tracks"), state="state")
    monkeypatch.setattr(room, "splits", lambda problem: iter(["split"]))
    monkeypatch.setattr(
        room,
        "score_stations",
        lambda problem, state, split, iterations: SimpleNamespace(scores=np.full(4, 0.0 if problem.tied else gain)),
    )
    monkeypatch.setattr(room, "compare_predicted_gains", lambda gains: SimpleNamespace(gain=gains.mean()))
    assert _predicts_better(solution, 5) == is_better
    monkeypatch.setattr(room, "splits", lambda problem: iter([]))
    assert _predicts_better(solution, 5)


@dataclass
class Tied:
    """A problem with or without tracks."""

    tied: object


def test_scene_is_placed_in_world_of_cell() -> None:
    """Bases, points and cameras on the world move with the base of the robot; mounts on flanges stay."""
    rng = np.random.default_rng(0)
    mounts, bases = SE3.exp(rng.standard_normal((2, 6))), SE3.exp(rng.standard_normal((2, 6)))
    points = rng.standard_normal((4, 3))
    cameras = (SimpleNamespace(robot="left"), SimpleNamespace(robot=None))
    state = SceneState(mounts, bases, (LENS, LENS), np.zeros((0, 6)), points)
    fit = Fit(SimpleNamespace(cameras=cameras), state)
    found = _place_in_world(fit, BASE).state
    np.testing.assert_allclose(found.mounts.matrix, [mounts[0].matrix, (BASE @ mounts[1]).matrix])
    np.testing.assert_allclose(found.bases.matrix, (BASE @ bases).matrix)
    np.testing.assert_allclose(found.points, BASE @ points)
    assert _place_in_world(fit, None) is fit


@dataclass
class Fit:
    """Views and a state."""

    views: SimpleNamespace
    state: SceneState


def test_robot_noise_is_that_of_own_stops() -> None:
    """The noise of a robot is that of its own stops, and unknown without stops in the other observations."""
    stops = SimpleNamespace(first={"right": 2, "left": 0}, sigma=np.arange(24.0).reshape(4, 6))
    solution = SimpleNamespace(problem=SimpleNamespace(stops=stops))
    np.testing.assert_array_equal(room._noise(solution, "right"), np.arange(12.0, 18))
    np.testing.assert_array_equal(room._noise(solution, "left"), np.arange(6.0))
    assert room._noise(solution, "other") is None


CELL = SimpleNamespace(reference="left", base_name=lambda n: f"base {n}", mount_name=lambda n: f"mount {n}")


def test_unobservable_transforms_start_from_scene() -> None:
    """Unobservable bases, mounts and lenses start from the scene; known ones stay, and the reference has no base."""
    views = SimpleNamespace(robots=("left", "right"), cameras=[SimpleNamespace(name=n) for n in ("a", "b")])
    of_scene = SimpleNamespace(bases=["none", "base"], mounts=["m a", "m b"], lenses=["lens a", "lens b"])
    state = State(
        {"base left": 0, "base right": 1, "mount a": 2, "mount b": 3, "board": 4}, {"b": "known"}, np.zeros((0, 6))
    )
    open_names = {"base left", "base right", "mount b", "board"}
    solution = SimpleNamespace(state=state, observability=SimpleNamespace(unobservable=open_names))
    found = room._first_state(CELL, solution, SimpleNamespace(views=views, state=of_scene))
    assert found.transforms == {"base left": 0, "base right": "base", "mount a": 2, "mount b": "m b", "board": 4}
    assert found.cameras == {"a": "lens a", "b": "known"}


@pytest.mark.parametrize("logs", [None, "estimated"])
def test_tracks_are_linearised_twice(monkeypatch, logs) -> None:
    """Tracks are linearised a second time about the first optimum, with the groups kept by the first.

    Noise that is not estimated stays; samples count for the camera that took them.
    """
    arguments: list[object] = []
    monkeypatch.setattr(room, "widening_factor", lambda fit: 3.0)
    monkeypatch.setattr(room, "_first_state", lambda cell, last, fit: "start")
    monkeypatch.setattr(room, "scene_groups", lambda cell, recording, problem, seen: arguments.append(seen) or "groups")

    def tie(problem, state, groups, fit, sigma_px):
        arguments.append((problem, state, groups, sigma_px))
        return f"tied {problem}"

    def solve_mode(problem, state, settings, findings, noise):
        arguments.append(settings.robot_noise)
        tied = None if len(arguments) < 4 else SimpleNamespace(groups="own")
        return replace(last, problem=Tied(tied), state="next")

    @dataclass(frozen=True)
    class Last:
        problem: object
        state: object
        noise: object
        findings: tuple[Finding, ...] = ()

    last = Last("problem", "at", SimpleNamespace(logs=logs))
    monkeypatch.setattr(room, "with_scene", tie)
    monkeypatch.setattr(room, "solve_at_mode", solve_mode)
    views = SimpleNamespace(
        cameras=[SimpleNamespace(name=n) for n in "ab"], sample=np.array([5, 6, 7]), camera=np.array([1, 0, 1])
    )
    fit = SimpleNamespace(views=views, sigma_px=0.5)
    found = room._solve_jointly(None, None, last, fit, Settings())
    noise = "stated" if logs is None else "estimated"
    assert arguments[0] == {"a": [6], "b": [5, 7]}
    assert arguments[1:3] == [("problem", "start", "groups", 1.5), noise]
    assert arguments[3][1:] == ("next", "groups", 1.5)
    assert arguments[4:] == [noise]
    assert found.state == "next"
