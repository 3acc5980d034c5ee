"""Random draws of all noise for one simulated cell, as one batch of trials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from basecal.errors import InputError
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem
from basecal.estimation.problem.view_group import End, ViewGroup
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import SE3, Array
from basecal.simulation import SimulatedCell
from basecal.studies.cells import Settings, simulate_cell

_CELLS, _NOISE = 0, 1  # purposes of random number generators


@dataclass(frozen=True, eq=False)
class Draws:
    """Trials on one cell with the same recorded robot poses, but different robot errors and pixel noise.

    Attributes:
        simulated: The cell, with a recording that defines the visible points of all trials.
        problem: The problem, with pixels of its views of shape (trials, n, p, 2).
        transform: Name of the evaluated transform.
        count: Number of trials.
        own_starts: Whether each trial is solved without a warm start.
    """

    simulated: SimulatedCell
    problem: Problem
    transform: str
    count: int
    own_starts: bool = False

    @property
    def truth(self) -> SE3:
        """True value of the evaluated transform."""
        return self.simulated.truth[self.transform]

    def measurement(self) -> PixelMeasurement:
        """Pixel measurement of the first group's views, in all trials."""
        return group_pixels(self.problem.groups[0])


def group_pixels(group: ViewGroup) -> PixelMeasurement:
    """Pixel measurement of a group of views.

    Raises:
        InputError: if the group has no pixels.
    """
    if not isinstance(group.measurement, PixelMeasurement):
        raise InputError(f"{group.camera} does not observe {group.target} as pixels")
    return group.measurement


@dataclass(frozen=True, eq=False)
class DrawnCell:
    """A cell of a study, built once before noise is drawn."""

    simulated: SimulatedCell
    problem: Problem
    transform: str


def draw_cell(settings: Settings, seed: int, cell: int, transform: str | None) -> DrawnCell:
    """Simulate the cell of a number; draws do not contain the noise of its own recording.

    Raises:
        InputError: if the settings are inconsistent, or too few poses show the target.
    """
    simulated = simulate_cell(
        settings, int(np.random.SeedSequence([seed, _CELLS, cell]).generate_state(1, np.uint64)[0] >> 1)
    )
    problem, _ = build_problem(simulated.cell, simulated.recording)
    return DrawnCell(simulated, problem, transform or simulated.cell.requested_transforms[0])


def draw(cell: DrawnCell, settings: Settings, seed: tuple[int, ...], count: int) -> Draws:
    """Draw trials on a cell.

    Robot errors change the true poses, which the cameras observe; the recorded poses do not change. The visible points
    are those of the cell's own recording.

    Args:
        cell: The cell.
        settings: Sizes of the noise, and faults.
        seed: Seed of the noise.
        count: Number of trials.
    """
    robot_seed, *group_seeds = np.random.SeedSequence((*seed[:1], _NOISE, *seed[1:])).spawn(
        1 + len(cell.problem.groups)
    )
    errors = _robot_errors(cell.problem, settings, robot_seed, count)
    groups = [
        _redraw_views(cell, group, errors, settings, np.random.default_rng(seed_of_group), count)
        for group, seed_of_group in zip(cell.problem.groups, group_seeds, strict=True)
    ]
    return Draws(cell.simulated, cell.problem.with_groups(groups), cell.transform, count, settings["own_starts"])


def _robot_errors(problem: Problem, settings: Settings, seed: np.random.SeedSequence, count: int) -> dict[str, SE3]:
    """Draw each robot's pose errors `recorded_from_true`, (count, stops), by robot; empty without noise."""
    sigma = np.repeat([settings["robot_sigma_t_m"], settings["robot_sigma_r_rad"]], 3)
    if not sigma.any():
        return {}
    each = zip(sorted(problem.stop_counts), seed.spawn(len(problem.stop_counts)), strict=True)
    return {
        name: SE3.exp(sigma * np.random.default_rng(own).standard_normal((count, problem.stop_counts[name], 6)))
        for name, own in each
    }


def _redraw_views(
    cell: DrawnCell,
    group: ViewGroup,
    errors: Mapping[str, SE3],
    settings: Settings,
    rng: np.random.Generator,
    count: int,
) -> ViewGroup:
    """The group of views with the pixels of each trial, (count, n, p, 2)."""
    measurement = group_pixels(group)
    exact = _exact_pixels(cell.simulated, group, errors, settings)
    shape = (count, *measurement.pixels.shape)
    pixels = exact + settings["pixel_px"] * rng.standard_normal(shape)
    if settings["correlated_px"]:
        pixels += settings["correlated_px"] * rng.standard_normal((*shape[:-2], 1, 2))
    if settings["image_noise"]:
        about_centre = exact - cell.simulated.cameras[group.camera].center
        pixels += settings["image_noise"] * about_centre * rng.standard_normal(shape)
    if settings["outlier_share"]:
        is_outlier = rng.random(shape[:-1]) < settings["outlier_share"]
        pixels += is_outlier[..., None] * rng.uniform(-settings["outlier_px"], settings["outlier_px"], shape)
    pixels[:, ~measurement.seen] = 0.0
    return replace(group, measurement=replace(measurement, pixels=pixels), readings=())


def _exact_pixels(simulation: SimulatedCell, group: ViewGroup, errors: Mapping[str, SE3], settings: Settings) -> Array:
    """Pixels without noise, (n, p, 2) [px], or (count, n, p, 2) if the robots have errors."""
    world_from_camera, world_from_target = (_world_from_body(simulation, end, errors) for end in group.ends)
    camera_from_target = world_from_camera.inverse() @ world_from_target
    true_points = settings["board_scale"] * group_pixels(group).points_in_target
    lens = simulation.cameras[group.camera]
    scale = np.concatenate([np.full(2, settings["focal_scale"]), np.ones(len(lens.parameters) - 2)])
    return lens.with_parameters(scale * lens.parameters).project(camera_from_target.add_axis() @ true_points)


def _world_from_body(simulation: SimulatedCell, end: End, errors: Mapping[str, SE3]) -> SE3:
    """Pose in the world of the camera or target at an end, (n,), or (count, n) if its robot has errors."""
    world_from_flange = end.world_from_base(simulation.truth) @ end.base_from_flange
    errors_of_robot = errors.get(end.robot or "")
    error = SE3.identity() if errors_of_robot is None else errors_of_robot[:, end.stop_number]
    return world_from_flange @ error @ simulation.truth[end.mount]
