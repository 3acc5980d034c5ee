"""Simulated cells with candidates from which a plan chooses, and the results of recording the chosen ones.

Each cell has two arms, the camera on one and a board on the other, both mounts unknown, 0.2 px, and noise of the arms'
stops. Nine poses are taught, without observations. Bases and mounts are guessed within 5 mm and 1 degree. The task's
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
from basecal.planning.choose import exchange, greedy_choices
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
    """A simulated cell with its candidates.

    Attributes:
        made: The cell and its truth.
        noise: True sigmas of the robots' stops [m, rad].
        prospect: The candidates.
        weight: (p, p) weight of the covariance at the task.
        point_m: (3,) the task in the reference's base [m].
    """

    made: SimulatedCell
    noise: tuple[float, float]
    prospect: Prospects
    weight: Array
    point_m: Array

    def choose(self, count: int) -> tuple[list[int], Array]:
        """Indices that the greedy search with exchange chooses, and the covariance with them."""
        steps = list(islice(greedy_choices(self.prospect.roots, self.prospect.covariance, self.weight), count))
        return exchange(self.prospect.roots, [k for k, _ in steps], steps[-1][1], self.weight)

    def covariance(self, chosen: list[int]) -> Array:
        """Covariance of all unknowns with these samples taken, (p, p)."""
        roots = self.prospect.roots[chosen]
        return np.asarray(
            np.linalg.inv(np.linalg.inv(self.prospect.covariance) + np.einsum("npq,nrq->pr", roots, roots))
        )

    def expected_m(self, covariance: Array) -> float:
        """The 95 % bound of errors at the task [m]."""
        columns = self.prospect.problem.columns[BASE]
        in_hand_m = self.prospect.state.transforms[BASE].inverse() @ self.point_m
        return length_quantile(point_covariances(covariance[columns, columns], in_hand_m[None])[0])

    def random(self, count: int, rng: np.random.Generator) -> list[int]:
        """A number of random candidates."""
        return [int(k) for k in rng.permutation(len(self.prospect.samples))[:count]]

    def solve(self, rows: list[int], draws: int, seed: int) -> SolutionBatch:
        """Solve the candidates as recorded `draws` times, with noise of robots and pixels."""
        rng, truth = np.random.default_rng([seed, 5]), self.made.truth
        recorded = [self.prospect.samples[row].robots for row in rows]
        sigmas = np.repeat(self.noise, 3)
        world_from = {}
        for robot, base in (("eye", SE3.identity()), ("hand", truth[BASE])):
            poses = SE3.stack([_pose(states[robot]) for states in recorded])
            world_from[robot] = base @ poses @ SE3.exp(rng.standard_normal((draws, len(rows), 6)) * sigmas)
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
        """True errors at the task [m] of the solutions of these samples, and their 95 % bounds.

        Returns:
            (draws, 2); draws that did not converge are left out.
        """
        batch = self.solve(rows, draws, seed)
        columns = self.prospect.problem.columns[BASE]
        errors = []
        for k in np.flatnonzero(batch.converged):
            mean = batch.state.transforms[BASE][k]
            error = mean @ (self.made.truth[BASE].inverse() @ self.point_m) - self.point_m
            point_covariance = point_covariances(
                batch.covariance[k, columns, columns], (mean.inverse() @ self.point_m)[None]
            )[0]
            errors.append((float(np.linalg.norm(error)), length_quantile(point_covariance)))
        return np.array(errors).reshape(-1, 2)


def _pose(state: RobotState) -> SE3:
    assert state.base_from_flange is not None
    return state.base_from_flange


def planned_cell(seed: int, noise: tuple[float, float] = NOISE, count: int = CANDIDATES) -> PlannedCell:
    """Simulate a cell with taught poses, guesses and candidates."""
    made = simulate(Scenario(samples=9, robot_noise=noise, pixel_px=PIXEL_PX), seed)
    rng = np.random.default_rng([seed, 3])
    guesses = {
        name: PoseEstimate(mean @ SE3.exp(GUESS * rng.standard_normal(6)), np.eye(6))
        for name, mean in made.truth.items()
    }
    guess = Calibration("doubtful", guesses)
    sketch = sketches(made.cell, guess)[0]
    taught = Recording(tuple(replace(sample, observations=()) for sample in made.recording.samples))
    samples = candidates(sketch, [dict(sample.robots) for sample in taught.samples], count, seed)
    prospect = prospects(made.cell, taught, guess, [(sketch, samples)])
    point = made.truth[BASE].translation / 2
    weight = make_meeting(made.cell, prospect.problem, prospect.state, BASE, point[None]).weight
    return PlannedCell(made, noise, prospect, weight, point)


def exhaustive(cell: PlannedCell, count: int, seed: int, starts: int = STARTS) -> float:
    """The least expected error [m] of exchanges from random starts and from the greedy one, each until convergence."""
    rng, ends = np.random.default_rng([seed, 7]), []
    for chosen in [cell.choose(count)[0], *(cell.random(count, rng) for _ in range(starts))]:
        covariance, before = cell.covariance(chosen), np.inf
        while float(np.trace(cell.weight @ covariance)) < before * (1 - 1e-6):
            before = float(np.trace(cell.weight @ covariance))
            chosen, covariance = exchange(cell.prospect.roots, chosen, covariance, cell.weight)
        ends.append(cell.expected_m(covariance))
    return min(ends)
