"""Derivatives of `camera_from_target` with respect to each unknown, by adjoints.

All tangents are right tangents: if an unknown is perturbed on its right by `xi`, the view becomes
`camera_from_target @ SE3.exp(D @ xi)`.
Source: docs/mathematics.md (3.1)-(3.3).
"""

from __future__ import annotations

import numpy as np

from basecal.estimation.problem.problem import Chain, Problem, State, Stops, stop_tangents
from basecal.estimation.problem.robot_parameters import column_derivative
from basecal.estimation.problem.view_group import ViewGroup
from basecal.geometry import SE3, Array, IntArray
from basecal.geometry.se3_jacobians import right_jacobian


def unknown_jacobian(
    problem: Problem, group: ViewGroup, links: Chain, state: State, rows: int
) -> tuple[Array, IntArray]:
    """Derivative of views with respect to the unknowns of their group.

    Args:
        problem: The problem.
        group: A group of n views.
        links: The factors of the views' `camera_from_target`.
        state: The state, or a batch of states.
        rows: 6, or 6 + k with the k parameters of the lens.

    Returns:
        The derivative, (..., n, rows, m), and its columns in the problem, (m,).
    """
    parts = links.frames(group)
    free = [(name, sign, link) for name, sign, link in parts if name in problem.columns]
    lens = problem.columns.get(group.camera) if rows > 6 else None
    places = [problem.columns[name] for name, _, _ in free] + ([lens] if lens else [])
    columns = [np.r_[place] for place in places]
    jacobian = np.zeros((*links.target_from_camera.shape, rows, sum(map(len, columns))))
    first = 0
    for (name, sign, link), own in zip(free, columns, strict=False):
        block = jacobian[..., :6, first : first + len(own)]
        if link is None:
            block[...] = sign * np.eye(6, len(own))
        elif len(own) == 3:  # a tip, which has no rotation
            block[..., :3, :] = sign * link.rotation
        else:
            link.put_adjoint(block, sign)
        if name in problem.gauges:
            block[..., problem.gauges[name] > 0] = 0.0
        first += len(own)
    if lens:
        jacobian[..., 6:, first:] = np.eye(rows - 6)
    all_columns = np.concatenate([np.zeros(0, dtype=np.int64), *columns])
    if not problem.models:
        return jacobian, all_columns
    robot_jacobian, robot_columns = robot_model_jacobian(problem, group, links, state, rows)
    return np.concatenate([jacobian, robot_jacobian], -1), np.concatenate([all_columns, robot_columns])


def robot_model_jacobian(
    problem: Problem, group: ViewGroup, links: Chain, state: State, rows: int
) -> tuple[Array, IntArray]:
    """Derivative of views with respect to the kinematic parameters of the robots of their group.

    Returns:
        The derivative, (..., n, rows, m), and its columns in the problem, (m,).
    """
    shape = links.target_from_camera.shape
    blocks, columns = [np.zeros((*shape, rows, 0))], [np.zeros(0, dtype=np.int64)]
    for end, link in zip(group.ends, links.ends, strict=True):
        model = problem.robot_model(end.robot)
        if model is None or end.joints is None:
            continue
        flange = link.target_from_flange
        if end.has_noise:  # the modelled flange pose, without the error of its stop
            flange = flange @ SE3.exp(-state.stop_errors[..., end.stop, :] * problem.stops.sigma[end.stop])
        jacobian = link.sign * flange.adjoint() @ column_derivative(model, state.kinematics(model), end.joints)
        block = np.zeros((*shape, rows, jacobian.shape[-1]))
        block[..., :6, :] = jacobian
        blocks.append(block)
        columns += [np.r_[problem.columns[name]] for name in model.widths]
    return np.concatenate(blocks, -1), np.concatenate(columns)


def stop_error_jacobians(
    group: ViewGroup, links: Chain, state: State, stops: Stops, rows: int
) -> list[tuple[IntArray, Array]]:
    """Derivative of views with respect to the errors, in sigmas, of their stops.

    Returns:
        For each end with noise, the stop of each view, (n,), and the derivative, (..., n, rows, 6).
    """
    noisy = [(end.stop, link) for end, link in zip(group.ends, links.ends, strict=True) if end.has_noise]
    if not noisy:
        return []
    tangents, n = stop_tangents(group, state, stops), len(group)
    error_jacobian = right_jacobian(tangents) * stops.sigma[np.concatenate([stop for stop, _ in noisy])][:, None, :]
    parts = []
    for k, (stop, link) in enumerate(noisy):
        adjoint = np.zeros((*link.target_from_flange.shape, 6, 6))
        link.target_from_flange.put_adjoint(adjoint, link.sign)
        by_error = adjoint @ error_jacobian[..., k * n : (k + 1) * n, :, :]
        if rows > 6:
            by_error = np.concatenate([by_error, np.zeros((*by_error.shape[:-2], rows - 6, 6))], -2)
        parts.append((stop, by_error))
    return parts
