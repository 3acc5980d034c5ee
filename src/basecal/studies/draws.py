"""Draws of all noise about one simulated cell, as one batch."""

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

_CELLS, _NOISE = 0, 1  # what a generator is for


@dataclass(frozen=True, eq=False)
class Draws:
    """Trials on one cell: what its robots recorded is the same in all, what they and the cameras did is not.

    Attributes:
        made: The cell, with a recording that is the shape of all.
        problem: What is solved for, its views' pixels (trials, n, p, 2).
        transform: Name of the transform that is judged.
        count: How many trials.
        own_starts: Whether each trial is to be solved from nothing.
    """

    made: SimulatedCell
    problem: Problem
    transform: str
    count: int
    own_starts: bool = False

    @property
    def truth(self) -> SE3:
        """Truth of the transform that is judged."""
        return self.made.truth[self.transform]

    def measurement(self) -> PixelMeasurement:
        """The measurement of the first group's views, in all trials."""
        return group_pixels(self.problem.groups[0])


def group_pixels(group: ViewGroup) -> PixelMeasurement:
    """The measurement of a group, which in a study is of pixels."""
    if not isinstance(group.measurement, PixelMeasurement):
        raise InputError(f"{group.camera} sees {group.target} not as pixels")
    return group.measurement


@dataclass(frozen=True, eq=False)
class DrawnCell:
    """A cell of a study as it is built once, before noise is drawn."""

    made: SimulatedCell
    problem: Problem
    transform: str


def draw_cell(settings: Settings, seed: int, cell: int, transform: str | None) -> DrawnCell:
    """A cell by its number; the noise that is in its own recording is in no draw.

    Raises:
        InputError: if the settings do not go together, or hardly any pose sees the target.
    """
    made = simulate_cell(
        settings, int(np.random.SeedSequence([seed, _CELLS, cell]).generate_state(1, np.uint64)[0] >> 1)
    )
    problem, _ = build_problem(made.cell, made.recording)
    return DrawnCell(made, problem, transform or made.cell.requested_transforms[0])


def draw(cell: DrawnCell, settings: Settings, seed: tuple[int, ...], count: int) -> Draws:
    """Draws, so many; the first of them are equal whatever their number.

    Where a robot's pose has an error the recorded poses stay, and the cameras see what is where the robots truly are.
    What was in view is as in the cell's own recording.

    Args:
        cell: What does not change.
        settings: Sizes of the noise, and faults.
        seed: Of the noise.
        count: How many.
    """
    for_robots, *for_groups = np.random.SeedSequence((*seed[:1], _NOISE, *seed[1:])).spawn(1 + len(cell.problem.groups))
    errors = _robot_errors(cell.problem, settings, for_robots, count)
    groups = [
        _redraw_views(cell, group, errors, settings, np.random.default_rng(own), count)
        for group, own in zip(cell.problem.groups, for_groups, strict=True)
    ]
    return Draws(cell.made, cell.problem.with_groups(groups), cell.transform, count, settings["own_starts"])


def _robot_errors(problem: Problem, settings: Settings, seed: np.random.SeedSequence, count: int) -> dict[str, SE3]:
    """Where each robot truly was as it recorded a pose, `recorded_from_true`, (count, stands); none without noise."""
    sigma = np.repeat([settings["robot_sigma_t_m"], settings["robot_sigma_r_rad"]], 3)
    if not sigma.any():
        return {}
    each = zip(sorted(problem.stands), seed.spawn(len(problem.stands)), strict=True)
    return {
        name: SE3.exp(sigma * np.random.default_rng(own).standard_normal((count, problem.stands[name], 6)))
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
    """The group as each trial sees it."""
    measurement = group_pixels(group)
    exact = _exact_pixels(cell.made, group, errors, settings)
    shape = (count, *measurement.pixels.shape)
    pixels = exact + settings["pixel_px"] * rng.standard_normal(shape)
    if settings["correlated_px"]:
        pixels += settings["correlated_px"] * rng.standard_normal((*shape[:-2], 1, 2))
    if settings["image_noise"]:
        about_centre = exact - cell.made.cameras[group.camera].center
        pixels += settings["image_noise"] * about_centre * rng.standard_normal(shape)
    if settings["outlier_share"]:
        off = rng.random(shape[:-1]) < settings["outlier_share"]
        pixels += off[..., None] * rng.uniform(-settings["outlier_px"], settings["outlier_px"], shape)
    pixels[:, ~measurement.seen] = 0.0
    return replace(group, measurement=replace(measurement, pixels=pixels), readings=())


def _exact_pixels(simulation: SimulatedCell, group: ViewGroup, errors: Mapping[str, SE3], settings: Settings) -> Array:
    """Pixels of the camera without noise, (n, p, 2), or (count, n, p, 2) if the robots have errors [px]."""
    world_from_camera, world_from_target = (_place_flange(simulation, end, errors) for end in group.ends)
    camera_from_target = world_from_camera.inverse() @ world_from_target
    true_points = settings["board_scale"] * group_pixels(group).points_in_target
    lens = simulation.cameras[group.camera]
    scale = np.concatenate([np.full(2, settings["focal_scale"]), np.ones(len(lens.parameters) - 2)])
    return lens.with_parameters(scale * lens.parameters).project(camera_from_target.spread() @ true_points)


def _place_flange(simulation: SimulatedCell, end: End, errors: Mapping[str, SE3]) -> SE3:
    """Pose in the world of what an end carries, (n,), or (count, n) if its robot has errors at its stands."""
    world_from_flange = end.world_from_base(simulation.truth) @ end.base_from_flange
    errors_of_robot = errors.get(end.robot or "")
    error = SE3.identity() if errors_of_robot is None else errors_of_robot[:, end.stand]
    return world_from_flange @ error @ simulation.truth[end.mount]
