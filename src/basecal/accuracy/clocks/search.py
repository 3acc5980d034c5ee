"""Search of clock offsets: Gauss-Newton steps to the optimum, and a grid over seconds if the steps fail.

Line times of rolling shutters are estimated with the offsets; each solution corrects the pixels for the next one.
`benchmarks.clocks` evaluates the limits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.clocks.step import ClockStep, clock_step
from basecal.accuracy.input_check.unexplained_motion import is_hopeless
from basecal.accuracy.readings.scales import convert_units, estimate_units
from basecal.cell import Recording
from basecal.errors import InputError, NotObservable
from basecal.estimation.noise.estimate import residual_counts
from basecal.estimation.outliers.noise_and_outliers import has_plausible_noise, with_noise
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_problem
from basecal.estimation.streams.jitter import with_jitter, with_passing_times
from basecal.estimation.streams.rolling_shutter import KnownGeometry, line_time_name
from basecal.estimation.streams.streams import Streams, Synchronised, synchronise

# Tried offsets [s]; for computers without synchronisation, a guess has to be stated. Steps converge from twice the
# spacing of these offsets for usual motions of arms.
_TRIED_OFFSETS_S = np.linspace(-1.0, 1.0, 21)
_TRIED_VIEWS = 40  # for a solution in a hundredth of a second
_TRIED_STEPS = 10  # of a descent: outside the basin of the offset, no descent converges
_STEPPED_VIEWS = 200  # views for steps until convergence
_OFFSET_STEPS = 8
_CONVERGED_SIGMAS = 0.05  # largest step at convergence, in sigmas


@dataclass(frozen=True, eq=False)
class ClockedRecording:
    """A recording that is synchronised with clock offsets.

    Attributes:
        streams: The recorded streams of each device.
        offsets_s: Clock offsets by device, and line times by `line_time_name` [s].
        synchronised: The synchronised samples.
        solution: A solution near the offsets; None if no solution was found.
    """

    streams: Streams
    offsets_s: dict[str, float]
    synchronised: Synchronised
    solution: Solution | None = None

    @property
    def recording(self) -> Recording:
        """The samples, with robot poses interpolated at the times of the views."""
        return self.synchronised.recording

    def add_jitter(self, problem: Problem) -> Problem:
        """Add the jitter of stamps and the times of robot motion to the problem of the samples."""
        return _add_jitter(problem, self.streams, self.synchronised, self.solution)


def search_offsets(streams: Streams, settings: Settings) -> ClockedRecording:
    """Synchronise a recording with the most likely offsets of its clocks; fixed offsets stay as stated.

    Raises:
        InputError: if the cell contradicts the recording.
    """
    offsets = streams.stated_offsets
    lines = [line_time_name(camera) for camera in streams.cell.cameras]
    many = streams.thin(_STEPPED_VIEWS)
    stepped, last, explained = _step_offsets(many, offsets, settings)
    if not explained:
        few = streams.thin(_TRIED_VIEWS)
        for name in streams.estimated_clocks:
            if name not in lines:
                offsets = _best_offset(few, offsets, name, settings)
        stepped, last, _ = _step_offsets(many, offsets, settings)
    if len(many.instants) < len(streams.instants):
        stepped, last, _ = _step_offsets(streams, stepped, settings)
    return ClockedRecording(streams, stepped, _synchronise(streams, stepped, last), last)


def _best_offset(streams: Streams, offsets: dict[str, float], name: str, settings: Settings) -> dict[str, float]:
    """Return the offsets with the tried offset of one clock that fits the views best."""
    clock = streams.clocks[name]
    shifts_s = (
        _TRIED_OFFSETS_S if clock.sigma_s is None else 3 * clock.sigma_s * np.linspace(-1, 1, len(_TRIED_OFFSETS_S))
    )
    tried = [{**offsets, name: clock.offset_s + float(shift)} for shift in shifts_s]
    misfits = [_misfit(streams, each, settings) for each in tried]
    return tried[int(np.argmin(misfits))] if np.isfinite(min(misfits)) else offsets


def _misfit(streams: Streams, offsets: dict[str, float], settings: Settings) -> float:
    """Minus twice the log likelihood per residual, robots assumed exact; infinite if the solve fails."""
    exact = {name: replace(robot, noise=None) for name, robot in streams.cell.robots.items()}
    known = replace(streams, cell=replace(streams.cell, robots=exact))
    try:
        quick = replace(settings, robot_noise="stated", iterations=_TRIED_STEPS)
        solution, _ = _solve_at_offsets(known, offsets, quick)
    except (InputError, NotObservable, np.linalg.LinAlgError):
        return np.inf
    counts = residual_counts(solution.problem)
    of_sigmas = sum(2 * n * np.log(getattr(solution.noise.noise, f)) for f, n in counts.items() if f != "stated")
    return float(solution.cost + of_sigmas) / max(sum(counts.values()), 1)


def _step_offsets(
    streams: Streams, offsets: dict[str, float], settings: Settings
) -> tuple[dict[str, float], Solution | None, bool]:
    """Step the offsets to convergence; return them, the last solution, and whether it is plausible.

    A solution is plausible if robot noise as of usual arms explains the views.
    """
    last: Solution | None = None
    explained = False
    for _ in range(_OFFSET_STEPS):
        is_converged = last is not None
        try:
            last, samples = _solve_at_offsets(streams, offsets, settings, last)
        except (NotObservable, np.linalg.LinAlgError):
            return offsets, last, False
        none_estimated = not (last.noise.robots or last.noise.jitter_s)
        explained = not is_hopeless(last.problem, last.state) and (none_estimated or has_plausible_noise(last))
        if streams.estimated_clocks:
            step = clock_step(streams, samples, offsets, last)
            offsets = _apply_step(offsets, step)
            is_converged &= bool(
                np.all(np.abs(step.step_s) <= _CONVERGED_SIGMAS * np.sqrt(np.diagonal(step.covariance)))
            )
        if is_converged:
            break
    return offsets, last, explained


def _apply_step(offsets: dict[str, float], step: ClockStep) -> dict[str, float]:
    steps = dict(zip(step.clocks, step.step_s.tolist(), strict=True))
    # Far from the optimum, a step may exceed the range in which the velocities are valid.
    reach = float(_TRIED_OFFSETS_S[-1])
    return {name: offset + float(np.clip(steps.get(name, 0.0), -reach, reach)) for name, offset in offsets.items()}


def _synchronise(streams: Streams, offsets: dict[str, float], guess: Solution | None) -> Synchronised:
    """Synchronise the samples, and correct pixels of rolling shutters by a nearby solution."""
    samples = synchronise(streams, offsets)
    if guess is None:
        return samples
    return samples.correct_rows(_known_motion(streams, guess), offsets)


def _known_motion(streams: Streams, guess: Solution) -> KnownGeometry:
    return KnownGeometry(streams.cell, guess.state.transforms, guess.state.cameras)


def _add_jitter(problem: Problem, streams: Streams, samples: Synchronised, guess: Solution | None) -> Problem:
    problem = with_passing_times(problem, samples, streams.cell)
    return (
        problem
        if guess is None
        else with_jitter(problem, _known_motion(streams, guess), samples.robots, streams.clocks)
    )


def _solve_at_offsets(
    streams: Streams, offsets: dict[str, float], settings: Settings, guess: Solution | None = None
) -> tuple[Solution, Synchronised]:
    samples = _synchronise(streams, offsets, guess)
    recording = convert_units(samples.recording, estimate_units(streams.cell, samples.recording)[0])
    problem = _add_jitter(build_problem(streams.cell, recording)[0], streams, samples, guess)
    plain = solve_problem(problem, streams.cell, replace(settings, robot_noise="stated", stages=None))
    noisy = plain if settings.robot_noise == "stated" else with_noise(plain, replace(settings, stages=None))
    return noisy, samples
