"""Mutants that nothing can tell from the original, by a part of the line that is changed."""

from __future__ import annotations

ANY_LENGTH = "to NumPy any negative length is the one that is left"
TWO_AXES = "the array has two axes, of which the last is axis 1"
EITHER_WAY = "either way the same solution"

# By file: part of the line, what stood there, what stands there now, why nothing differs.
EQUIVALENT: dict[str, tuple[tuple[str, str, str, str], ...]] = {
    "estimation/view/moments.py": (
        ("_TARGETS = 32", "32", "33", "monomials of one target more are kept"),
        ("np.frombuffer(points).reshape(-1, 3)", "1", "2", ANY_LENGTH),
        ("rotation.reshape(-1, 3, 3)", "1", "2", ANY_LENGTH),
        ("planes.reshape(len(planes), -1", "1", "2", ANY_LENGTH),
        ("plane.reshape(-1, len(of_points))", "1", "2", ANY_LENGTH),
    ),
    "estimation/view/pixels.py": (
        ("_CHUNK_POINTS = 28800", "28800", "28801", "a chunk of one point more"),
        ("_CHUNK_LENS_POINTS = 12000", "12000", "12001", "a chunk of one point more"),
    ),
    "estimation/view/target_points.py": (
        ("rows = [int(np.argmax(np.sum(", "-1", "1", TWO_AXES),
        ("apart = np.minimum(apart", "-1", "1", TWO_AXES),
    ),
    "estimation/view/view_pose.py": (
        ("flat, size =", "-1", "1", TWO_AXES),
        ("flat, size =", "1", "2", "any size near that of the points serves"),
        (
            "axes = of.axes * np.array",
            "of.axes * np.array([1.0, 1.0, np.linalg.det(of.axes)])",
            "of.axes / np.array([1.0, 1.0, np.linalg.det(of.axes)])",
            "a determinant of 1 or -1 is its own inverse",
        ),
        ("enough = seen.sum(-1)", "-1", "1", TWO_AXES),
        ("cost = np.stack([best.cost", "-1", "1", "of arrays of one axis the last of the stack is axis 1"),
        ("matrix[along < 0]", "along < 0", "along <= 0", "only without any point is the sum zero"),
        ("scale = lengths(axes.mT).mean(-1)", "-1", "1", TWO_AXES),
        (
            "cross(axes[:, :, 0], axes[:, :, 1])",
            "0",
            "1",
            "the nearest rotation has its third axis across the other two anyway",
        ),
        ("sight = at / np.maximum(lengths(at), 1e-12)", "1e-12", "1e-11", "no target stands in the camera itself"),
    ),
    "estimation/start/closed_form.py": (
        ("_NOTHING = 1e-300", "1e-300", "1e-299", "either is next to nothing"),
        (
            "return -values if np.linalg.det(matrix) < 0",
            "np.linalg.det(matrix) < 0",
            "np.linalg.det(matrix) <= 0",
            "where the determinant is zero either sign serves",
        ),
        ("squares[:81, 81:], squares[81:, :81]", "-mixed.T", "mixed.T", "of a symmetric matrix LAPACK reads one half"),
        ("solution = least_norm(rows.reshape(-1", "1", "2", ANY_LENGTH),
    ),
    "estimation/start/base_graph.py": (
        ("jacobian = _jacobian(sides", "6", "7", "columns of nothing take no step"),
        ("np.abs(step).max(initial=0.0)", "0.0", "1.0", "without bases there is no step in any round"),
    ),
    "estimation/start/all_pairs.py": (("found = float(np.median(", "-1", "1", TWO_AXES),),
    "estimation/start/pair_views.py": (
        ("np.argmax(agreement, axis=-1)", "-1", "1", TWO_AXES),
        (
            "if len(found) < len(group)",
            "len(found) < len(group)",
            "len(found) <= len(group)",
            "of all views all are taken",
        ),
        ("shown = 1.0 if", "-1", "1", TWO_AXES),
        ("enough = np.flatnonzero(measurement.seen.sum(-1)", "-1", "1", TWO_AXES),
        ("unit = p / np.maximum(", "1e-12", "1e-11", "no point stands in the camera itself"),
        ("share = weight / weight.sum(-1", "-1", "1", TWO_AXES),
        (
            "spread = np.einsum(",
            "p_in_b - centre_b[:, None]",
            "p_in_b + centre_b[:, None]",
            "it is enough that the other points are about their centre",
        ),
        (
            "spread = np.einsum(",
            "p_in_a - centre_a[:, None]",
            "p_in_a + centre_a[:, None]",
            "it is enough that the other points are about their centre",
        ),
    ),
    "estimation/start/lens.py": (
        ("terms = np.arange(start.camera", "-1", "1", TWO_AXES),
        ("enough = np.flatnonzero(measurement.seen", "-1", "1", TWO_AXES),
        ("cost = np.sum([view.cost.sum(-1)", "-1", "1", TWO_AXES),
    ),
    "estimation/start/rotation_search.py": (
        ("found = {k: turn[:, 0].copy()", "0", "1", "the first rounds find them all anew"),
        (
            "share = weight**2 / np.sum",
            "weight ** 2 / np.sum(weight ** 2, -1, keepdims=True)",
            "weight ** 2 * np.sum(weight ** 2, -1, keepdims=True)",
            "sums are compared within a loop alone",
        ),
        ("share = weight**2 / np.sum", "-1", "1", TWO_AXES),
        ("reshape(h, -1)", "1", "2", ANY_LENGTH),
        ("best = np.argpartition(", "-1", "1", TWO_AXES),
        ("best = best[row, np.argsort(", "-1", "1", TWO_AXES),
        ("best = np.argsort(angle", "-1", "1", TWO_AXES),
        ("total: Array = np.sqrt(3 * squares)", "3", "4", "from any start above the sum the rounds lead to it"),
    ),
    "estimation/start/rotation_grid.py": (
        (
            "tuple(np.array([base[i] for i in p]) *",
            "np.array([base[i] for i in p]) * [s[i] if i < 3 else 1 for i in p]",
            "np.array([base[i] for i in p]) / [s[i] if i < 3 else 1 for i in p]",
            "signs are their own inverses",
        ),
        (
            "first = np.array([q[np.flatnonzero",
            "q[np.flatnonzero(np.abs(q) > 1e-09)[0]] > 0",
            "q[np.flatnonzero(np.abs(q) > 1e-09)[0]] <= 0",
            "q and -q are one rotation",
        ),
        (
            "first = np.array([q[np.flatnonzero",
            "q[np.flatnonzero(np.abs(q) > 1e-09)[0]] > 0",
            "q[np.flatnonzero(np.abs(q) > 1e-09)[0]] >= 0",
            "the first that is not zero is not zero",
        ),
        ("first = np.array([q[np.flatnonzero", "1e-09", "1e-08", "entries are zero or above a quarter"),
        ("length = np.linalg.norm(along", "1e-12", "1e-11", "no light stands in the camera itself"),
        (
            "length = np.linalg.norm(along",
            "np.linalg.norm(along, axis=-1) + 1e-12",
            "np.linalg.norm(along, axis=-1) - 1e-12",
            "no light stands in the camera itself",
        ),
        ("score = np.mean(1 - depth", "1", "2", "the order of scores is the same"),
        ("score = np.mean(1 - depth", "-1", "1", TWO_AXES),
        ("flat = projected.reshape(len(rows), -1", "1", "2", ANY_LENGTH),
        ("right = (across @ constant[..., None]).reshape(", "1", "2", ANY_LENGTH),
    ),
    "estimation/start/nearest_rotations.py": (
        ("largest = np.sqrt(3 * squares)", "3", "4", "from any start above the largest root the rounds lead to it"),
    ),
    "estimation/start/refinement.py": (
        (
            'points = getattr(group.measurement, "points_in_target"',
            "0",
            "1",
            "measurements without points are of a kind of their own",
        ),
        (
            'points = getattr(group.measurement, "points_in_target"',
            "3",
            "4",
            "measurements without points are of a kind of their own",
        ),
        ("turns = [[Rotations(*turn, True)", "True", "False", "translations do not ask whether rotations are clear"),
        ("states = State({k: SE3.stack", "0", "1", "a pair alone has no stops"),
        ("states = State({k: SE3.stack", "6", "7", "a pair alone has no stops"),
    ),
    "estimation/least_squares/studentized.py": (
        (
            "information = spectrum(np.where(finite",
            "0.0",
            "1.0",
            "what is lost is infinitely far, whatever stands there",
        ),
        ("gradient = np.where(finite", "0.0", "1.0", "what is lost is infinitely far, whatever stands there"),
        ("left = above(np.eye(leverage.shape[-1])", "-1", "1", "the matrices are square"),
        ("left = above(np.eye(leverage.shape[-1])", "1", "2", "the matrices are square"),
        ("freedoms = np.maximum(information.rank", "-1", "1", TWO_AXES),
        ("return np.asarray(measurement.seen.sum(-1)", "-1", "1", TWO_AXES),
        (
            "certain = np.asarray((determinant",
            "a > 0",
            "a >= 0",
            "with a determinant above zero no diagonal entry is zero",
        ),
        ("certain = np.asarray((determinant", "0", "1", "what is not certain goes the long way, to the same end"),
        ("/ np.where(certain, determinant, 1.0), certain", "1.0", "10.0", "what is not certain goes the long way"),
        ("by_error = np.zeros((n, q, 6 * len(private)))", "6", "7", "columns of nothing change nothing"),
        ("by_error[of.view, :, 6 * i : 6 * i + 6]", "6", "7", "a slice ends with the array"),
        ("both, i, j = np.intersect1d", "True", "False", "views are there once"),
    ),
    "estimation/least_squares/normal_equations.py": (
        ("_MANY = 64", "64", "65", EITHER_WAY),
        ("view_costs = np.where(weights[number] > 0", "0.0", "1.0", "it is multiplied by a weight of zero"),
        ("after = SE3.stack([state.transforms[name]", "0", "1", "without names nothing is taken of it"),
        ("by_error[..., of.view, :, 6 * i", "6", "7", "a slice ends with the array"),
        ("force[..., of.view, 6 * i", "6", "7", "a slice ends with the array"),
        (
            "if inner.size // inner.shape[-1] ** 2 >= _MANY",
            "inner.size // inner.shape[-1] ** 2 >= _MANY",
            "inner.size // inner.shape[-1] ** 2 < _MANY",
            EITHER_WAY,
        ),
        (
            "if inner.size // inner.shape[-1] ** 2 >= _MANY",
            "inner.size // inner.shape[-1] ** 2",
            "inner.size * inner.shape[-1] ** 2",
            EITHER_WAY,
        ),
        ("if inner.size // inner.shape[-1] ** 2 >= _MANY", "inner.shape[-1] ** 2", "inner.shape[-1] * 2", EITHER_WAY),
        ("if inner.size // inner.shape[-1] ** 2 >= _MANY", "-1", "1", EITHER_WAY),
        ("if inner.size // inner.shape[-1] ** 2 >= _MANY", "1", "2", EITHER_WAY),
        ("if inner.size // inner.shape[-1] ** 2 >= _MANY", "2", "3", EITHER_WAY),
        ("shared_step = np.zeros((0, 6))", "0", "1", "without shared stops it is not used"),
        ("shared_step = np.zeros((0, 6))", "6", "7", "without shared stops it is not used"),
    ),
    "estimation/least_squares/schur_complement.py": (
        ("both, a, b = np.intersect1d", "True", "False", "views are there once"),
        ("factor = splu(", "True", "False", "the same solution by other pivots"),
        ("flat = self.gradient.reshape(", "1", "2", ANY_LENGTH),
        ("flat: Array = sum_over @ first.reshape(", "1", "2", ANY_LENGTH),
    ),
    "estimation/least_squares/jacobians.py": (
        ("(group.camera_mount, -1.0", "1.0", "10.0", "of this number the sign alone is used"),
        ("(group.eye_base, -1.0", "1.0", "10.0", "of this number the sign alone is used"),
        ("(group.hand_base, 1.0", "1.0", "10.0", "of this number the sign alone is used"),
        ("signed = ((-1.0, links.target_from_eye_flange)", "1.0", "10.0", "of this number the sign alone is used"),
        ("lens = problem.columns.get(group.camera) if rows > 6", "6", "7", "a lens has four parameters or more"),
    ),
    "estimation/problem/same_stop.py": (
        ("stated = np.zeros(6) if noise is None", "6", "7", "the least of zeros is zero"),
        ("parts = [base_from_flange.translation", "1", "2", ANY_LENGTH),
        ("places = np.concatenate(parts, axis=-1)", "-1", "1", TWO_AXES),
        (
            "near = np.all(np.abs(places[1:]",
            "np.abs(places[1:] - places[:-1]) <= 2",
            "np.abs(places[1:] - places[:-1]) < 2",
            "what is as far as this has ended a run anyhow",
        ),
        ("near = np.all(np.abs(places[1:]", "2", "3", "what is as far as this has ended a run anyhow"),
        ("near = np.all(np.abs(places[1:]", "-1", "1", TWO_AXES),
    ),
    "estimation/problem/correspondence.py": (
        ("costs = np.stack([reading.linearise(", "False", "True", "the cost is the same with the lens's columns"),
    ),
}
