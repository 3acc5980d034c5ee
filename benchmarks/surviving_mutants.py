"""Why mutants survive: those that nothing can tell from the original, and those that no test does so far."""

from __future__ import annotations

from typing import Any

from benchmarks.equivalent_mutants import EQUIVALENT

UNKNOWN = "no test of its room tells the two apart so far"

# By file, line, what stood there and what stands there now.
WHY: dict[tuple[str, str, str, str], str] = {
    (
        "geometry/lens.py",
        "_REAL = 1e-9  # imaginary parts of a root below this share of it are rounding",
        "1e-09",
        "1e-08",
    ): "equivalent: roots that are nearly double come with either of the two by rounding",
    (
        "geometry/lenses/fisheye.py",
        "low, high = np.where(miss > 0, angle, low), np.where(miss > 0, high, angle)",
        "miss > 0",
        "miss >= 0",
    ): "equivalent: where nothing is missed the angle is found",
    (
        "geometry/rotation.py",
        "values: Array = coefficients[-1] * x2",
        "1",
        "2",
    ): "equivalent: the last of nine terms is a thousandth of rounding",
    (
        "cell/journal/recording_file.py",
        'if journal.read(1) == b"\\n":',
        "1",
        "2",
    ): "equivalent: there is but one byte to the end",
    (
        "cell/results/calibration_dict.py",
        'is_plain = value.dtype.kind == "f" and bool(np.all(np.abs(value) <= LARGEST_NUMBER))',
        "value.dtype.kind == 'f'",
        "value.dtype.kind != 'f'",
    ): "equivalent: the same lists, made number by number",
    (
        "accuracy/robot_parameters.py",
        "if not solution.observability.unobservable:",
        "not solution.observability.unobservable",
        "solution.observability.unobservable",
    ): "no test so far: the variances of offsets that nothing shows are wide enough in every cell that was tried",
    (
        "estimation/outliers/robust_scale.py",
        "table: Array = self._limits(np.arange(int(freedoms.max(initial=0)) + 1))",
        "1",
        "2",
    ): "equivalent: a row more of the table is computed and not used",
    (
        "estimation/outliers/view_ransac.py",
        "return np.asarray(seen & np.array(kept, dtype=bool).reshape(-1, 1, p))",
        "1",
        "2",
    ): "equivalent: to NumPy any negative length is the one that is left",
    (
        "accuracy/clocks/search.py",
        "explained = False",
        "False",
        "True",
    ): "equivalent: set again before it is read",
    (
        "accuracy/cross_validation/station_scores.py",
        "gradient, information = view.gradient[:, :6], view.information[:, :6, :6]",
        "6",
        "7",
    ): "equivalent: without the lens there are six columns",
    (
        "accuracy/input_check/hypotheses.py",
        'words = "in millimetres" if factor < 1 else "1000 times too small"',
        "1",
        "2",
    ): "equivalent: the factor is 0.001 or 1000",
    (
        "estimation/view/view_pose.py",
        "sight = camera_from_plane.translation / np.maximum(away, 1e-12)",
        "1e-12",
        "1e-11",
    ): "equivalent: keeps a quotient of zeros finite",
    (
        "estimation/start/pair_views.py",
        "_RIDGE = 1e-9  # [1/m^2, 1/rad^2] of views that hold no pose: next to no weight, not none",
        "1e-09",
        "1e-08",
    ): "equivalent: with either the weight is below a ten-thousandth",
    (
        "cell/schema/cell_dict.py",
        'data |= {"sigma_distortion": one_or_all(lens.sigma[4:])} if len(lens.sigma) > 4 else {}',
        "4",
        "5",
    ): "equivalent: no lens has a single term",
    (
        "estimation/least_squares/cauchy_irls.py",
        "_FIRST_STEPS = 3  # steps before the first weights: the start is rough",
        "3",
        "4",
    ): "no test so far: a step more from a rough start, before 25 rounds",
    (
        "estimation/outliers/subset_starts.py",
        "drawn = bundle_adjust_batch(read, drawn, 1, _FEW_STEPS, weights).state",
        "1",
        "2",
    ): "no test so far: where a rough descent may stop, which others go on from",
    (
        "accuracy/clocks/search.py",
        "return float(solution.cost + of_sigmas) / max(sum(counts.values()), 1)",
        "1",
        "2",
    ): "equivalent: there is more than one residual",
    (
        "accuracy/findings/lens_model.py",
        "sigma = np.sqrt(np.maximum(np.diag(of.solution.covariance_of([name])), 0.0))[: where.stop - where.start]",
        "where.stop - where.start",
        "where.stop + where.start",
    ): "equivalent: the covariance has no more rows",
    (
        "estimation/outliers/view_ransac.py",
        "cost = np.minimum(squares, limit).sum(-1) + tension",
        "-1",
        "1",
    ): "equivalent: the last of two axes",
    (
        "estimation/view/view_pose.py",
        "matrix = matrix / np.maximum(scale, 1e-12)[:, None, None]",
        "1e-12",
        "1e-11",
    ): "equivalent: keeps a quotient of zeros finite",
    (
        "estimation/least_squares/normal_equations.py",
        "symmetric = 0.5 * (hessian + np.swapaxes(hessian, -1, -2))",
        "-1",
        "1",
    ): "equivalent but for rounding: without it the sums are as symmetric as their terms",
    (
        "estimation/least_squares/cauchy_irls.py",
        "scale = np.maximum(np.quantile(np.concatenate(ratios, -1), _MOST, axis=-1, keepdims=True), 1e-30)",
        "-1",
        "1",
    ): "equivalent: the last of two axes",
    (
        "estimation/observability/motions.py",
        "off = (carried - mean).reshape(-1, 6)",
        "1",
        "2",
    ): "equivalent: to NumPy any negative length is the one that is left",
    (
        "estimation/solve.py",
        "eye_base_from_hand_base = fused([s.base() for s in stations], [1.0] * len(stations))",
        "1.0",
        "10.0",
    ): "equivalent: all weights are alike, and shares of their sum",
    (
        "estimation/start/lens.py",
        "chords = BearingMeasurement(measurement.points_in_target, np.where(valid[..., None], bearings, 0.0), weight)",
        "0.0",
        "1.0",
    ): "equivalent: these directions have no weight",
    (
        "estimation/start/rotation_search.py",
        "_LOOPS_AT_A_TIME = 8",
        "8",
        "9",
    ): "equivalent: loops side by side do not know of one another",
    (
        "estimation/view/pixels.py",
        "size = max(1, (_CHUNK_LENS_POINTS if lens else _CHUNK_POINTS) // max(points, 1))",
        "1",
        "2",
    ): "equivalent: views say the same in chunks of any size",
    (
        "geometry/se3.py",
        "if left.ndim > 2 and left.shape[-3] == 1 and right.ndim > 2:",
        "2",
        "3",
    ): "equivalent: the same product the slower way",
    (
        "kinematics/urdf.py",
        "if link not in above or len(way) > len(above):",
        "len(way) > len(above)",
        "len(way) >= len(above)",
    ): "equivalent: a way of as many joints as there are that goes on is a ring",
    (
        "estimation/least_squares/normal_equations.py",
        "return _Marginal(gradient, information, np.zeros(gradient.shape[:-1]), np.zeros(gradient.shape[:-2]))",
        "2",
        "3",
    ): "equivalent: a zero is added to all of a batch",
    (
        "estimation/noise/target_shape.py",
        "return measurement.points_in_target if isinstance(measurement, PixelMeasurement) else np.zeros((0, 3))",
        "3",
        "4",
    ): "equivalent: of no points only their number is asked",
    (
        "estimation/noise/view_estimates.py",
        "if by_shape is not None and by_shape.shape[-1] == by_shape[..., 0].size:",
        "0",
        "1",
    ): "equivalent: one slice is as large as another",
    (
        "estimation/outliers/robust_scale.py",
        "if not now.any() or np.array_equal(now, within):",
        "not now.any() or np.array_equal(now, within)",
        "not now.any() and np.array_equal(now, within)",
    ): "equivalent: further rounds change nothing, and the better half is always within",
    (
        "estimation/view/view_pose.py",
        "matrix = smallest_vectors(_squared_misses(bearings, homogeneous)).reshape(len(bearings), 3, -1)",
        "1",
        "2",
    ): "equivalent: to NumPy any negative length is the one that is left",
    (
        "cell/format/yaml_text.py",
        "_WIDTH = 4096  # characters before a line is broken: a matrix stays on one",
        "4096",
        "4097",
    ): "no test so far: a line of 4096 characters more or less",
    (
        "accuracy/drift/shared_errors.py",
        "_HIDDEN = 1e-9  # share of the information below which a direction of a camera's place is not seen",
        "1e-09",
        "1e-08",
    ): "no test so far: shares of rounding are far below either, those of what is seen far above",
    (
        "estimation/observability/observability.py",
        "few = [g.take(slice(None, None, -(-len(g) // _ENOUGH_VIEWS))) for g in problem.groups if len(g)]",
        "-(-len(g) // _ENOUGH_VIEWS)",
        "-len(g) // _ENOUGH_VIEWS",
    ): "no test so far: every other view, counted from the last: the median is of others",
    (
        "accuracy/systematic_errors/score_tests.py",
        "tied = np.zeros((0 if system is None else len(system.precision), 6, b, q))",
        "0",
        "1",
    ): "equivalent: without shared stops these sums are not used",
    (
        "geometry/lens.py",
        "if not np.any((square > _BEFORE_LAST**2) | (determinant < _REGULAR)):  # what is no number stays none",
        "2",
        "3",
    ): "equivalent: a step of Newton's method more, where it has converged",
    (
        "estimation/start/closed_form.py",
        "rows = (np.concatenate([left, -right], -1) * weight[:, None, None]).reshape(-1, 18)",
        "1",
        "2",
    ): "equivalent: to NumPy any negative length is the one that is left",
    (
        "estimation/start/rotation_grid.py",
        "tuple(np.array([base[i] for i in p]) * [s[i] if i < 3 else 1 for i in p])",
        "1",
        "2",
    ): "equivalent: this sign is of a zero",
    (
        "accuracy/task/budget.py",
        "return BudgetEntry(name, rms_m, variance / total if total > 0 else 0.0, left_m)",
        "total > 0",
        "total >= 0",
    ): "equivalent: where there is no error no source has a part of it",
    (
        "accuracy/residuals/loops.py",
        "while len(steps) > 2 and steps[0].path == steps[-1].path[::-1]:",
        "2",
        "3",
    ): "equivalent: every step leads to another base, so that none lies between one forth and the same one back",
    (
        "accuracy/lens_structure.py",
        "_AT_A_TIME = 400  # views whose derivatives are held at once: more take memory that no cache holds",
        "400",
        "401",
    ): "equivalent: how many views are held at once changes the time alone",
    (
        "accuracy/lens_structure.py",
        "flat = known.reshape(-1, known.shape[-1])",
        "1",
        "2",
    ): "equivalent: to NumPy any negative length is the one that is left",
    (
        "accuracy/lens_structure.py",
        "columns = columns - known @ (inverse @ (flat.T @ columns.reshape(len(flat), -1)))",
        "1",
        "2",
    ): "equivalent: to NumPy any negative length is the one that is left",
    (
        "accuracy/lens_structure.py",
        "rest = np.concatenate([residual.reshape(n, r, 1), weighted[..., 6:].reshape(n, r, -1)], axis=-1)",
        "1",
        "2",
    ): "equivalent: to NumPy any negative length is the one that is left",
    (
        "accuracy/input_check/target_sizes.py",
        "return float(least_norm(rows.reshape(-1, rows.shape[-1]), right.reshape(-1))[0])",
        "1",
        "2",
    ): "equivalent: to NumPy any negative length is the one that is left",
    (
        "accuracy/input_check/rare_hypotheses.py",
        "centres = numbers[:_CENTRES].reshape(-1, 3)",
        "1",
        "2",
    ): "equivalent: to NumPy any negative length is the one that is left",
    (
        "accuracy/input_check/rare_hypotheses.py",
        "return _within_half_a_turn(np.stack([angles, np.column_stack([first + np.pi, other, last + np.pi])], axis=1))",
        "first + np.pi",
        "first - np.pi",
    ): "equivalent: whole turns are taken off",
    (
        "accuracy/input_check/rare_hypotheses.py",
        "return _within_half_a_turn(np.stack([angles, np.column_stack([first + np.pi, other, last + np.pi])], axis=1))",
        "last + np.pi",
        "last - np.pi",
    ): "equivalent: whole turns are taken off",
    (
        "accuracy/input_check/rare_hypotheses.py",
        "within: Array = (angles + np.pi) % (2 * np.pi) - np.pi",
        "angles + np.pi",
        "angles - np.pi",
    ): "equivalent: whole turns are taken off",
    (
        "accuracy/task/expected_error.py",
        "c2 = np.where(known, 1.0, c2)",
        "1.0",
        "10.0",
    ): "equivalent: where the length is known nothing is made of it",
    (
        "accuracy/task/expected_error.py",
        "skew, tails = np.where(known, 1.0, c3 / c2**1.5), np.where(known, 1.0, c4 / c2**2)",
        "1.0",
        "10.0",
    ): "equivalent: where the length is known nothing is made of it",
    (
        "accuracy/task/expected_error.py",
        'up, turn = np.meshgrid((nodes + 1) / 2, (np.arange(_NODES) + 0.5) / _NODES * np.pi / 2, indexing="ij")',
        "nodes + 1",
        "nodes - 1",
    ): "equivalent: the nodes lie alike to both sides of 0, and only squares of these count",
    (
        "accuracy/task/expected_error.py",
        "for _ in range(4):",
        "4",
        "5",
    ): "equivalent: a power more is computed and not used",
    (
        "accuracy/input_check/hypothesis_fit.py",
        "return trimmed(self.off, 1.0)",
        "1.0",
        "10.0",
    ): "equivalent: there are no more than all",
    (
        "accuracy/input_check/hypothesis_fit.py",
        "if trimmed(every, 1.0) < _HEAVY_TAIL * trimmed(every):",
        "1.0",
        "10.0",
    ): "equivalent: there are no more than all",
    (
        "accuracy/residuals/loops.py",
        "while len(steps) > 2 and steps[0].path == steps[-1].path[::-1]:",
        "len(steps) > 2",
        "len(steps) >= 2",
    ): "equivalent: no two steps are one forth and the same one back, since every step leads to another base",
    (
        "accuracy/axis_shift.py",
        'weights = near if settings.station_choice == "nearest" else 1 / distance**2',
        "1",
        "2",
    ): "equivalent: weights are divided by their sum",
    (
        "accuracy/phrases/null_space.py",
        "return _numbers(unit * np.sign(unit[np.argmax(np.round(np.abs(unit), 3))]))",
        "unit * np.sign(unit[np.argmax(np.round(np.abs(unit), 3))])",
        "unit / np.sign(unit[np.argmax(np.round(np.abs(unit), 3))])",
    ): "equivalent: a sign is 1 or -1",
    (
        "accuracy/phrases/robot_motion.py",
        "first = first * np.sign(first[np.argmax(np.round(np.abs(first), 3))])  # its largest component positive",
        "first * np.sign(first[np.argmax(np.round(np.abs(first), 3))])",
        "first / np.sign(first[np.argmax(np.round(np.abs(first), 3))])",
    ): "equivalent: a sign is 1 or -1",
    (
        "accuracy/phrases/gravity.py",
        "apart = float(np.degrees(np.arccos(np.clip(min(cosines, default=1.0), -1, 1))))",
        "1.0",
        "10.0",
    ): "equivalent: it is cut to 1",
    (
        "accuracy/residuals/fit.py",
        "rms = np.sqrt(np.nansum(off_px**2, axis=(1, 2)) / np.maximum(count, 1))",
        "1",
        "2",
    ): "equivalent: a view of a point has two coordinates, and of none the sum is 0",
    (
        "accuracy/residuals/fit.py",
        "weight = np.where(enough[:, None], measurement.weight, 1.0) ** 2",
        "1.0",
        "10.0",
    ): "equivalent: points that all weigh the same count the same",
    (
        "numerics/spectral.py",
        "_RIDGE, _TINY = 1e-15, 1e-100  # of the trace, and of none: a singular matrix has an inverse with them",
        "1e-100",
        "1e-99",
    ): "equivalent: keeps a matrix of zeros regular",
    (
        "accuracy/cross_validation/closed_form_rival.py",
        "chance = float(stdtr(len(gain) - 1, -gain.mean() / max(spread, 1e-300)))",
        "1e-300",
        "1e-299",
    ): "equivalent: keeps a quotient by zero finite",
    (
        "accuracy/cross_validation/validation.py",
        "effective = freedoms**2 / max(correlation, 1e-300)",
        "1e-300",
        "1e-299",
    ): "equivalent: keeps a quotient by zero finite",
    (
        "accuracy/findings/late_pictures.py",
        "by_s = -by_time / np.maximum(per_s2, 1e-300)",
        "1e-300",
        "1e-299",
    ): "equivalent: keeps a quotient by zero finite",
    (
        "accuracy/findings/systematic_error.py",
        "along = values / max(length, 1e-300)",
        "1e-300",
        "1e-299",
    ): "equivalent: keeps a quotient by zero finite",
    (
        "kinematics/mjcf.py",
        "return Masses(kg, moments / np.where(kg > 0, kg, 1.0)[:, None], down)",
        "1.0",
        "10.0",
    ): "equivalent: what stands here is not used",
    (
        "kinematics/urdf.py",
        "return Masses(kg, moments / np.where(kg > 0, kg, 1.0)[:, None], down) if np.any(kg) else None",
        "1.0",
        "10.0",
    ): "equivalent: what stands here is not used",
    (
        "numerics/levenberg_marquardt.py",
        "flight = _moved(flight, candidate, after, cost, better, np.maximum(expected, 1e-300), bend)",
        "1e-300",
        "1e-299",
    ): "equivalent: keeps a quotient by zero finite",
    (
        "numerics/levenberg_marquardt.py",
        "scale = 1 / np.sqrt(np.maximum(diagonal, 1e-12 * diagonal.max(axis=1, initial=1e-300, keepdims=True)))",
        "1e-300",
        "1e-299",
    ): "equivalent: the largest of nothing",
    (
        "numerics/sparse_hessian.py",
        "return np.asarray(1 / np.sqrt(np.maximum(diagonal, _LEAST_DIAGONAL * diagonal.max(initial=1e-300))))",
        "1e-300",
        "1e-299",
    ): "equivalent: the largest of nothing",
    (
        "numerics/spectral.py",
        "_NOTHING = 1e-300  # keeps quotients of zeros finite",
        "1e-300",
        "1e-299",
    ): "equivalent: keeps a quotient by zero finite",
    (
        "numerics/spectral.py",
        "size = np.where(self.held, 1 / np.sqrt(np.where(self.held, self.values, 1.0)), 0.0)",
        "1.0",
        "10.0",
    ): "equivalent: what stands here is not used",
    (
        "numerics/spectral.py",
        "return np.asarray(np.sum(np.where(self.held, along**2 / np.where(self.held, self.values, 1.0), 0.0), -1))",
        "1.0",
        "10.0",
    ): "equivalent: what stands here is not used",
}


def reason(survivor: dict[str, Any]) -> str:
    """Why it survives."""
    file, text, change = survivor["file"], survivor["text"], (survivor["old"], survivor["new"])
    for part, old, new, why in EQUIVALENT.get(file, ()):
        if part in text and change == (old, new):
            return f"equivalent: {why}"
    return WHY.get((file, text, *change), UNKNOWN)


def is_equivalent(survivor: dict[str, Any]) -> bool:
    """Whether nothing that a test could see differs."""
    return reason(survivor).startswith("equivalent")
