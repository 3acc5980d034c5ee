"""Simulated cells with candidates of which a plan chooses, and what comes of recording those chosen.

Each cell has two arms, the camera on one, a board on the other, both mounts unknown, 0.2 px, and noise of the robots'
stops. Nine poses are taught, without observations; bases and mounts are guessed within 5 mm and 1 degree. The task's
point is half way between the bases.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from basecal.accuracy.task.expected_error import length_quantile, point_covariances
from basecal.accuracy.task.meeting import make_meeting
from basecal.cell import Calibration, PixelObservation, Recording, RobotState, Sample
from basecal.estimation.least_squares.bundle_adjustment import batch_states
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.solve_batch import SolutionBatch, solve_batch
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import SE3, Array, PoseEstimate
from basecal.planning.candidates import candidates
from basecal.planning.choose import exchange, greedy
from basecal.planning.prospects import Prospects, prospects, sketches
from basecal.simulation import Scenario, SimulatedCell, simulate

BASE = "eye_base_from_hand_base"
NOISE = (1e-4, 2e-4)  # [m, rad] per axis and stop
PIXEL_PX = 0.2
GUESS = np.repeat([5e-3, np.radians(1)], 3)
CANDIDATES = 600
STARTS = 5  # random starts of the exchange that counts as exhaustive


@dataclass(frozen=True, eq=False)
class PlannedCell:
    """A cell with what could be recorded of it.

    Attributes:
        made: The cell and its truth.
        noise: True sigmas of the robots' stops [m, rad].
        prospect: The candidates.
        weight: (p, p) of the task.
        point_m: (3,) the task in the reference's base [m].
    """

    made: SimulatedCell
    noise: tuple[float, float]
    prospect: Prospects
    weight: Array
    point_m: Array

    def chosen(self, count: int) -> tuple[list[int], Array]:
        """Greedy with exchange: which, and the covariance with them."""
        steps = list(islice(greedy(self.prospect.roots, self.prospect.covariance, self.weight), count))
        return exchange(self.prospect.roots, [k for k, _ in steps], steps[-1][1], self.weight)

    def covariance(self, chosen: list[int]) -> Array:
        """Of all unknowns with these samples taken, (p, p)."""
        roots = self.prospect.roots[chosen]
        return np.asarray(
            np.linalg.inv(np.linalg.inv(self.prospect.covariance) + np.einsum("npq,nrq->pr", roots, roots))
        )

    def expected_m(self, covariance: Array) -> float:
        """What 95 of 100 errors at the task are to stay below [m]."""
        where = self.prospect.problem.columns[BASE]
        in_hand_m = self.prospect.state.transforms[BASE].inverse() @ self.point_m
        return length_quantile(point_covariances(covariance[where, where], in_hand_m[None])[0])

    def random(self, count: int, rng: np.random.Generator) -> list[int]:
        """So many candidates, each set alike likely."""
        return [int(k) for k in rng.permutation(len(self.prospect.samples))[:count]]

    def solved(self, rows: list[int], draws: int, seed: int) -> SolutionBatch:
        """The candidates as they are seen `draws` times, robots off where they say to be, pixels by their noise."""
        rng, truth = np.random.default_rng([seed, 5]), self.made.truth
        recorded = [self.prospect.samples[row].robots for row in rows]
        off = np.repeat(self.noise, 3)
        world_from = {}
        for robot, base in (("eye", SE3.identity()), ("hand", truth[BASE])):
            said = SE3.stack([_pose(states[robot]) for states in recorded])
            world_from[robot] = base @ said @ SE3.exp(rng.standard_normal((draws, len(rows), 6)) * off)
        camera = world_from["eye"] @ truth["eye_flange_from_wrist"]
        board = world_from["hand"] @ truth["hand_flange_from_board"]
        shape = self.made.cell.targets["board"].target
        assert shape is not None
        camera_from_board = camera.inverse() @ board
        in_camera = shape.points @ np.swapaxes(camera_from_board.rotation, -1, -2)
        pixels = self.made.cameras["wrist"].project(in_camera + camera_from_board.translation[..., None, :])
        pixels = pixels + PIXEL_PX * rng.standard_normal(pixels.shape)
        samples = [
            Sample(k, robots=states, observations=(PixelObservation("wrist", "board", shape.ids, pixels[0, k]),))
            for k, states in enumerate(recorded)
        ]
        problem, _ = build_problem(self.made.cell, Recording(tuple(samples)))
        (group,) = problem.groups
        assert isinstance(group.measurement, PixelMeasurement)
        batch = problem.with_groups([replace(group, measurement=replace(group.measurement, pixels=pixels))])
        start = State(self.prospect.state.transforms, self.made.cameras, np.zeros((len(problem.stops), 6)))
        return solve_batch(batch, batch_states(batch, [start] * draws))

    def errors_m(self, rows: list[int], draws: int, seed: int) -> Array:
        """The true error at the task [m] of what these samples are solved to, and what 95 of 100 are to stay below.

        Returns:
            (draws, 2); draws that did not converge are left out.
        """
        found = self.solved(rows, draws, seed)
        where = self.prospect.problem.columns[BASE]
        told = []
        for k in np.flatnonzero(found.converged):
            mean = found.state.transforms[BASE][k]
            moved = mean @ (self.made.truth[BASE].inverse() @ self.point_m) - self.point_m
            at = point_covariances(found.covariance[k, where, where], (mean.inverse() @ self.point_m)[None])[0]
            told.append((float(np.linalg.norm(moved)), length_quantile(at)))
        return np.array(told).reshape(-1, 2)


def _pose(state: RobotState) -> SE3:
    assert state.base_from_flange is not None
    return state.base_from_flange


def planned_cell(seed: int, noise: tuple[float, float] = NOISE, count: int = CANDIDATES) -> PlannedCell:
    """A cell with taught poses, guesses and candidates."""
    made = simulate(Scenario(samples=9, robot_noise=noise, pixel_px=PIXEL_PX), seed)
    rng = np.random.default_rng([seed, 3])
    guesses = {
        name: PoseEstimate(mean @ SE3.exp(GUESS * rng.standard_normal(6)), np.eye(6))
        for name, mean in made.truth.items()
    }
    guessed = Calibration("doubtful", guesses)
    sketch = sketches(made.cell, guessed)[0]
    taught = Recording(tuple(replace(sample, observations=()) for sample in made.recording.samples))
    drawn = candidates(sketch, [dict(sample.robots) for sample in taught.samples], count, seed)
    prospect = prospects(made.cell, taught, guessed, [(sketch, drawn)])
    point = made.truth[BASE].translation / 2
    weight = make_meeting(made.cell, prospect.problem, prospect.state, BASE, point[None]).weight
    return PlannedCell(made, noise, prospect, weight, point)


def exhaustive(of: PlannedCell, count: int, seed: int, starts: int = STARTS) -> float:
    """The least expected error [m] of exchanges from random starts and from the greedy one, each until it rests."""
    rng, found = np.random.default_rng([seed, 7]), []
    for chosen in [of.chosen(count)[0], *(of.random(count, rng) for _ in range(starts))]:
        covariance, before = of.covariance(chosen), np.inf
        while float(np.trace(of.weight @ covariance)) < before * (1 - 1e-6):
            before = float(np.trace(of.weight @ covariance))
            chosen, covariance = exchange(of.prospect.roots, chosen, covariance, of.weight)
        found.append(of.expected_m(covariance))
    return min(found)
