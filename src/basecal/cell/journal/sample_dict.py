"""Conversion of a sample to the plain data of a line of `samples.jsonl`."""

from __future__ import annotations

import posixpath
from collections.abc import Mapping
from typing import Any

from basecal.cell.format.plain import numbers, one_or_all, pose_dict, sigma_dict
from basecal.cell.recording import (
    CandidateObservation,
    Observation,
    PixelObservation,
    PointObservation,
    PoseObservation,
    Sample,
    TouchObservation,
)
from basecal.geometry import Array


def sample_to_dict(sample: Sample, folder: str) -> dict[str, Any]:
    """Convert a sample to the data of a line; paths are relative to `folder` of the cell."""
    data: dict[str, Any] = {"sample": int(sample.sample)}
    if sample.stamp_s is not None:
        data["stamp_s"] = float(sample.stamp_s)
    data["robots"] = {name: {} for name in sample.robots}
    for name, state in sample.robots.items():
        if state.base_from_flange is not None:
            data["robots"][name]["base_from_flange"] = pose_dict(state.base_from_flange)
        elif state.joints_rad is not None:
            data["robots"][name]["joints_rad"] = numbers(state.joints_rad)
    data["images"] = _paths(sample.images, folder)
    data["background"] = _paths(sample.background, folder)
    data["observations"] = [_observation(view) for view in sample.observations]
    data["observations"] += [
        {"camera": view.camera, "tracks": view.tracks.tolist(), "pixels": numbers(view.pixels)}
        for view in sample.tracks
    ]
    return {key: value for key, value in data.items() if value not in ({}, [])}


def _paths(paths: Mapping[str, str], folder: str) -> dict[str, str]:
    return {camera: posixpath.relpath(path, folder) for camera, path in paths.items()}


def _observation(observation: Observation) -> dict[str, Any]:
    if isinstance(observation, TouchObservation):
        sigmas = {"sigma_m": observation.sigma_m, "sigma_rad": observation.sigma_rad}
        names = (
            {"clamp": observation.tip}
            if observation.kind == "clamp"
            else {observation.kind: observation.mark, "tip": observation.tip}
        )
        return {**names, **{key: sigma for key, sigma in sigmas.items() if sigma is not None}}
    data: dict[str, Any] = {"camera": observation.camera, "target": observation.target}
    match observation:
        case PixelObservation():
            data |= {
                "ids": observation.ids.tolist(),
                "pixels": numbers(observation.pixels),
                **_sigma("sigma_px", observation.sigma_px),
            }
        case CandidateObservation():
            data |= {"candidates": numbers(observation.pixels), **_sigma("sigma_px", observation.sigma_px)}
        case PoseObservation():
            sigma = {} if observation.sigma is None else sigma_dict(observation.sigma)
            data["camera_from_target"] = pose_dict(observation.camera_from_target) | sigma
        case PointObservation():
            points = numbers(observation.points_in_camera)
            data |= {
                "ids": observation.ids.tolist(),
                "points_in_camera_m": points,
                **_sigma("sigma_m", observation.sigma_m),
            }
    return data


def _sigma(key: str, values: Array | None) -> dict[str, Any]:
    return {} if values is None else {key: one_or_all(values)}
