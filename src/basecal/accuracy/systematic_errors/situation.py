"""A solved problem as input of effects: derivatives of views with respect to flanges and frames, and sample times."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from basecal.accuracy.systematic_errors.score_tests import Linearised, linearise_views, with_random_effects
from basecal.effects.faces.candidates import Group, Moves
from basecal.effects.registry import CHANGES_IN_TIME, RANDOM_EFFECTS
from basecal.estimation.noise.estimate import NoiseEstimate
from basecal.estimation.noise.random_effects import scaled_shared_errors
from basecal.estimation.problem.build import recorded_by_joints
from basecal.estimation.problem.gauges import LENGTH_M
from basecal.estimation.problem.problem import Chain, Problem, State, chain
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.solve import Solution
from basecal.estimation.view.points import is_touch
from basecal.geometry import SE3, Array, IntArray
from basecal.kinematics import SerialChain
from basecal.numerics.spectral import scaled_spectrum

# Rms distance of poses from the middle of their neighbours, relative to half the rms distance of the neighbours:
# 1.7 for poses in random order, near 0 on a smooth path; the limit is assumed.
_SMOOTH = 0.5
_FEWEST_ON_PATH = 8  # smallest number of poses that can form a path; assumed


class OpenOffsets(NamedTuple):
    """The r clock offsets that are estimated with a solution.

    Attributes:
        moves: For each group, (n, 6, r) right tangents of `camera_from_target` per offset [per s].
        sigma_s: (r,) prior sigmas, at least as large as the offsets' distance from their stated values [s]. Sigmas of
            free offsets are so large that the data alone determine these offsets.
        values: (r,) offsets at the solution relative to the stated values, in sigmas.
    """

    moves: Moves
    sigma_s: Array
    values: Array


@dataclass(frozen=True, eq=False)
class Situation:
    """A solved problem.

    Attributes:
        problem: The problem, with the noise in use.
        state: The optimum of the problem.
        recorded: The recorded problem, including outliers.
        stamps: Time of each sample by number [s]; samples without a time are absent.
        noise: The noise in use; if None, stops share no errors.
        offsets: Clock offsets that are estimated with the problem; None without any.
    """

    problem: Problem
    state: State
    recorded: Problem
    stamps: Mapping[int, float]
    noise: NoiseEstimate | None = None
    offsets: OpenOffsets | None = None

    @cached_property
    def linearisation(self) -> Linearised:
        """The problem linearised about its state."""
        return linearise_views(self.problem, self.state)

    @cached_property
    def null(self) -> Linearised:
        """The model against which effects are tested: with the random effects that stops share, and clock offsets."""
        model = self.linearisation
        if self.noise is not None and self.noise.beside_common is not None:
            model = null_model(self.problem, self.state, self.noise, self.flange_jacobian)
        if self.offsets is None:
            return model
        moves = tuple(None if m is None else m * self.offsets.sigma_s for m in self.offsets.moves)
        return with_random_effects(model, moves, self.offsets.values)

    def random_effect(self, effect: str, subject: str) -> str:
        """Name of the random effect in the null model of an effect on `subject`; "" if none or if replaced by it."""
        common = {} if self.noise is None else self.noise.common
        same = (subject in robots and effect in RANDOM_EFFECTS[name].replaced_by for name, robots in common.items())
        return "" if any(same) else next(iter(common), "")

    def is_held_in_time(self, effect: str) -> bool:
        """Whether an effect is a change in time that random errors in time, estimated with it, may contain."""
        common = {} if self.noise is None else self.noise.common
        return effect in CHANGES_IN_TIME and any(RANDOM_EFFECTS[name].by_times is not None for name in common)

    def null_model(self, effect: str, subject: str) -> Linearised:
        """Null model of an effect; it has no random effects if the effect replaces one, or if they may contain it."""
        is_random = bool(self.random_effect(effect, subject)) and not self.is_held_in_time(effect)
        return self.null if is_random else self.linearisation

    @cached_property
    def links(self) -> tuple[Chain, ...]:
        """The factors of `camera_from_target` of each group."""
        return tuple(chain(group, self.state, self.problem.stops) for group in self.problem.groups)

    @cached_property
    def samples(self) -> IntArray:
        """Numbers of all recorded samples, ordered by time, or by number if any has no time."""
        numbers = self.recorded.samples
        if not all(int(n) in self.stamps for n in numbers):
            return numbers
        return numbers[np.argsort([self.stamps[int(n)] for n in numbers], kind="stable")]

    @cached_property
    def has_times(self) -> bool:
        """Whether all samples have a time, and the times differ."""
        times = {self.stamps.get(int(n)) for n in self.samples}
        return None not in times and len(times) > 1

    @cached_property
    def times(self) -> Array:
        """Times of `samples` [s]; their indices if `has_times` is false."""
        if not self.has_times:
            return np.arange(len(self.samples), dtype=np.float64)
        return np.array([self.stamps[int(n)] for n in self.samples], dtype=np.float64)

    @property
    def groups(self) -> tuple[ViewGroup, ...]:
        """The groups of views."""
        return self.problem.groups

    @cached_property
    def fixed_frames(self) -> tuple[str, ...]:
        """Names of the frames that are stated as fixed."""
        return tuple(name for name in self.frames if self.problem.unknowns[name].status == "fixed")

    @property
    def point_mounts(self) -> frozenset[str]:
        """Names of the mounts of single points, whose rotation has no effect."""
        return self.problem.point_mounts

    @cached_property
    def targets(self) -> tuple[str, ...]:
        """Names of the targets that have a size."""
        shaped = {g for g in self.groups if not is_touch(g.measurement)}
        return tuple(sorted({g.target for g in shaped if g.hand.mount not in self.problem.point_mounts}))

    @cached_property
    def chains(self) -> dict[str, SerialChain]:
        """Stated kinematics of the robots that were recorded by joints at more than one pose, by name."""
        chains = self.problem.chains
        return {r: chains[r] for r in self.robots if r in chains and recorded_by_joints(self.problem, r)}

    @cached_property
    def estimated_effects(self) -> dict[str, frozenset[str]]:
        """Names of the effects that are estimated as unknowns, by robot or camera."""
        clocks = dict.fromkeys(self.recorded.open_clocks, frozenset({"clock_offset"}))
        models = {robot: self.problem.robot_model(robot) for robot in self.problem.models}
        return clocks | {robot: frozenset(model.columns) for robot, model in models.items() if model is not None}

    def sample_indices(self, group: Group) -> IntArray:
        """Indices into `samples` of a group's views, (n,)."""
        order = np.argsort(self.samples)
        return np.asarray(order[np.searchsorted(self.samples[order], group.sample)], dtype=np.int64)

    def depends(self, k: int, name: str) -> bool:
        """Whether views of a group depend on a transform."""
        return name in self.problem.groups[k].frames

    def target_from_camera(self, k: int) -> SE3:
        """Poses of the camera in the target frame for the views of a group, (n,)."""
        return self.links[k].target_from_camera

    @cached_property
    def robots(self) -> tuple[str, ...]:
        """Names of the robots with more than one recorded stop."""
        stops = {
            r: np.concatenate([end.stop_number for end in self.problem.robot_ends(r)]) for r in self.problem.robots
        }
        return tuple(robot for robot, numbers in stops.items() if len(np.unique(numbers)) > 1)

    @cached_property
    def mounts(self) -> dict[str, str]:
        """Names of the robots with more than one recorded stop, by the names of the mounts that they carry."""
        ends = (end for group in self.groups for end in group.ends)
        return {end.mount: end.robot for end in ends if end.robot is not None and end.robot in self.robots}

    @cached_property
    def down(self) -> Array:
        """Direction of gravity in the reference's base, (3,), from the first arm with known masses; -z without any."""
        for robot, base in self._bases.items():
            chain = self.problem.chains.get(robot)
            if chain is not None and chain.masses is not None:
                return base.rotation @ chain.masses.down
        return np.array([0.0, 0.0, -1.0])

    @cached_property
    def _bases(self) -> dict[str, SE3]:
        """Poses of the bases in the reference's base, by robot, the reference first."""
        bases = {end.robot: end.base for g in self.groups for end in g.ends if end.robot is not None}
        ordered = sorted(bases.items(), key=lambda pair: pair[1] is not None)
        return {r: SE3.identity() if base is None else self.state.transforms[base] for r, base in ordered}

    def down_in_flange(self, k: int, robot: str) -> Array:
        """Direction of gravity in a robot's flange frame for the views of a group, (n, 3)."""
        return self.down @ (self._bases[robot].rotation @ self.recorded_pose(k, robot).rotation)

    def transform(self, name: str) -> SE3:
        """Return the estimated mount or base with a name."""
        return self.state.transforms[name]

    @cached_property
    def frames(self) -> tuple[str, ...]:
        """Names of the transforms that views depend on: mounts and bases."""
        return tuple(dict.fromkeys(name for group in self.problem.groups for name in group.frames))

    def flange_jacobian(self, k: int, robot: str) -> Array:
        """Derivative of a group's views with respect to a right tangent of a robot's flange, (n, 6, 6)."""
        group, links = self.problem.groups[k], self.links[k]
        out = np.zeros((len(group), 6, 6))
        for end, link in zip(group.ends, links.ends, strict=True):
            if end.robot == robot:
                link.target_from_flange.put_adjoint(out, link.sign)
        return out

    def frame_jacobian(self, k: int, name: str) -> Array:
        """Derivative of a group's views with respect to a right tangent of a transform, (n, 6, 6)."""
        group, links = self.problem.groups[k], self.links[k]
        out = np.zeros((len(group), 6, 6))
        for own, sign, link in links.frames(group):
            if own == name:
                out += sign * (np.eye(6) if link is None else link.adjoint())
        return out

    def recorded_pose(self, k: int, robot: str) -> SE3:
        """Recorded poses of a robot's flange in a group's views, (n,); identity if the group does not use the robot."""
        group = self.problem.groups[k]
        end = group.robot_end(robot)
        return SE3.identity((len(group),)) if end is None else end.base_from_flange

    def velocity(self, robot: str) -> Array | None:
        """Body velocity of a robot at each of `samples`, (n, 6) [m, rad per unit of `times`]; None without a path."""
        where, poses = self._path(robot)
        if len(where) < _FEWEST_ON_PATH:
            return None
        times = self.times[where]
        before, after = np.maximum(np.arange(len(where)) - 1, 0), np.minimum(np.arange(len(where)) + 1, len(where) - 1)
        apart = (poses[before].inverse() @ poses[after]).log()
        middle = poses[before] @ SE3.exp(0.5 * apart)
        between = slice(1, -1)
        if not _rms_m((middle.inverse() @ poses).log()[between]) < _SMOOTH * 0.5 * _rms_m(apart[between]):
            return None
        span = np.tile((times[after] - times[before])[:, None], 6)
        out = np.zeros((len(self.samples), 6))
        out[where] = np.divide(apart, span, out=np.zeros_like(apart), where=span > 0)
        return out

    def _path(self, robot: str) -> tuple[IntArray, SE3]:
        """Indices into `samples` at which a robot was recorded, (m,), and its poses there, (m,)."""
        rotation, translation = np.zeros((len(self.samples), 3, 3)), np.zeros((len(self.samples), 3))
        seen = np.zeros(len(self.samples), dtype=bool)
        for g in self.recorded.groups:
            end = g.robot_end(robot)
            if end is not None:
                indices, poses = self.sample_indices(g), end.base_from_flange
                rotation[indices], translation[indices], seen[indices] = poses.rotation, poses.translation, True
        where = np.flatnonzero(seen).astype(np.int64)
        return where, SE3(rotation[where], translation[where])


def situate(
    solution: Solution,
    recorded_problem: Problem | None = None,
    stamps: Mapping[int, float] | None = None,
    offsets: OpenOffsets | None = None,
) -> Situation:
    """Return the situation of a solution; without `recorded_problem` it has no outliers, without `stamps` no times."""
    problem = solution.noise.hold_sigmas(solution.problem)
    return Situation(problem, solution.state, recorded_problem or problem, stamps or {}, solution.noise, offsets)


def _rms_m(tangents: Array) -> float:
    """Root mean square of tangents, (n, 6), with angles multiplied by an arm's length [m]."""
    return float(np.sqrt(np.mean(np.sum((tangents * np.repeat([1.0, LENGTH_M], 3)) ** 2, axis=1))))


# Smallest information about a random effect, in units of its prior; less information hardly changes its posterior.
# `benchmarks.false_alarms` tests it.
_LEAST_SEEN = 1e-2


def null_model(
    problem: Problem, state: State, noise: NoiseEstimate, flange_jacobian: Callable[[int, str], Array]
) -> Linearised:
    """Linearise a problem about a state, with the likeliest random effects of the noise as additional columns.

    The sigmas of single stops and views are those estimated jointly with these effects. Sigmas that were estimated
    without the effects absorb errors that stops share, and also the errors of any effect under test.

    Args:
        problem: The problem, with the sigmas of `noise`.
        state: The optimum of the problem.
        noise: The noise in use, with random effects.
        flange_jacobian: Function of group and robot: derivative of the views with respect to a right tangent of the
            flange, (n, 6, 6).
    """
    assert noise.beside_common is not None
    beside = noise.beside_common.hold_sigmas(problem)
    # Keep the errors of stops unchanged in metres and radians.
    errors = state.stop_errors * problem.stops.sigma / beside.stops.sigma
    model = linearise_views(beside, replace(state, stop_errors=errors))
    return with_random_effects(model, _independent_moves(model, _effect_moves(problem, noise.common, flange_jacobian)))


def _effect_moves(
    problem: Problem, common: Mapping[str, Mapping[str, Array]], flange_jacobian: Callable[[int, str], Array]
) -> Moves:
    """Right tangents of each group's views for one sigma of each error that stops share, (n, 6, r)."""
    units, moves = scaled_shared_errors(problem, common), []
    for k, group in enumerate(problem.groups):
        parts = []
        for robot, unit in units.items():
            end = group.robot_end(robot)
            still = np.zeros((len(group), 6, unit.shape[-1]))
            parts.append(still if end is None else flange_jacobian(k, robot) @ unit[end.stop_number])
        moves.append(np.concatenate(parts, axis=-1) if parts else None)
    return tuple(moves)


def _independent_moves(model: Linearised, moves: Moves) -> Moves:
    """Transform random effects into independent effects, and keep those that the views determine."""
    pairs = [(views.information[:, :6, :6], m) for views, m in zip(model.views, moves, strict=True) if m is not None]
    if not pairs:
        return moves
    information = sum(np.tensordot(m, h @ m, ((0, 1), (0, 1))) for h, m in pairs)
    spectral = scaled_spectrum(np.asarray(information), _LEAST_SEEN)
    return tuple(None if m is None else m @ spectral.vectors[:, spectral.is_informative] for m in moves)
