"""Files of other programs, damaged by a seed: lenses, targets and hand-eye recordings."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from basecal.exchange.importers.arrays import read_record_of_arrays
from basecal.exchange.importers.colmap import read_colmap_images
from basecal.exchange.importers.data_set import read_data_set_record
from basecal.exchange.importers.easy_handeye import read_easy_handeye_record
from basecal.exchange.importers.kalibr import read_camchain, read_target
from basecal.exchange.importers.lerobot import find_film, write_images
from basecal.exchange.importers.moveit_samples import is_joint_states, read_joint_states, read_moveit_record
from basecal.exchange.importers.mrcal import read_cameramodel
from basecal.exchange.importers.opencv import read_opencv_lens
from basecal.exchange.importers.points import read_points
from basecal.exchange.importers.touches import read_touches
from basecal.exchange.joints import read_joints
from basecal.exchange.lens_files.camera_info import read_camera_info
from basecal.exchange.lens_files.colmap import read_colmap_lenses
from basecal.exchange.lerobot import read_episode
from basecal.kinematics import read_chain
from colmap_files import IMAGES, binary_images, text_images
from torment.damage import damaged, torn_bytes
from torment.outcome import run_reader
from torment.workbooks import read_damaged_workbook

Trial = Callable[[Random, Path], str]
_BY_BYTES = 0.4  # of the trials; in the others the data is damaged, and written as JSON
_SIX_AXIS = Path(__file__).parents[1] / "data" / "urdf" / "six_axis.urdf"
_FILM = Path(__file__).parents[1] / "data" / "film_av1.mp4"
_TORN = 0.8  # of the tables of LeRobot
_MATRIX = [766.5, 0.0, 640.9, 0.0, 765.4, 358.8, 0.0, 0.0, 1.0]
_POSE = {"translation": {"x": 0.1, "y": 0.2, "z": 0.3}, "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
_FLAT = {"x": 0.1, "y": 0.2, "z": 0.3, "qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0}
_LENS = {"fx": 550.0, "fy": 551.0, "cx": 320.0, "cy": 240.0}
_CAMERA = {
    "camera_model": "pinhole",
    "intrinsics": [460.0, 461.0, 360.0, 240.0],
    "distortion_model": "radtan",
    "distortion_coeffs": [-0.2, 0.06, 0.0, 0.0],
    "resolution": [752, 480],
    "T_cn_cnm1": np.eye(4).tolist(),
}
_XML = """<?xml version="1.0"?>
<opencv_storage><camera_matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt>
<data>5e2 0. 320. 0. 5e2 240. 0. 0. 1.</data></camera_matrix><dist>0.1 0. 0. 0.</dist></opencv_storage>
"""
_YAML = """%YAML:1.0
---
K: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5e2, 0., 320., 0., 5e2, 240., 0., 0., 1. ]
"""
_MODEL = """{ 'lensmodel': 'LENSMODEL_OPENCV4', 'intrinsics': [600, 601, 320, 240, 0.1, -0.2, 0, 0],
 'extrinsics': [0,0,0,0,0,0], 'imagersize': [640, 480], 'optimization_inputs': b'P)h>@6aWAK' }"""
_COLMAP = struct.pack("<QiiQQ8d", 1, 1, 4, 640, 480, 600, 601, 320.5, 240.5, 0.1, -0.2, 0, 0)


def _of_data(data: Any, name: str, read: Callable[[Path], object]) -> Trial:
    """A trial on plain data, of which fields or bytes are damaged."""

    def trial(chance: Random, folder: Path) -> str:
        content = json.dumps(data, indent=chance.choice([None, 1])).encode()
        if chance.random() < _BY_BYTES:
            content = torn_bytes(content, chance)
        else:
            content = json.dumps(damaged(data, chance)).encode()
        (folder / name).write_bytes(content)
        return run_reader(lambda: read(folder / name))

    return trial


def _of_texts(texts: dict[str, bytes], read: Callable[[Path], object]) -> Trial:
    """A trial on the bytes of one of several files, by their names."""

    def trial(chance: Random, folder: Path) -> str:
        name = chance.choice(list(texts))
        (folder / name).write_bytes(torn_bytes(texts[name], chance, faults=2))
        return run_reader(lambda: read(folder / name))

    return trial


def _moveit(path: Path) -> object:
    return read_joint_states(path) if is_joint_states(path) else read_moveit_record(path, True)


def _data_set(path: Path) -> object:
    (path.parent / "0.png").write_bytes(b"")
    (path.parent / "0.yaml").write_text(json.dumps(_FLAT))
    return read_data_set_record(path)


def _joints(path: Path) -> object:
    return read_joints(str(path), "hand", read_chain(_SIX_AXIS, "base_link", "tool0"), True)


def _points(path: Path) -> object:
    return read_points(path.parent / "cell", path, camera="tracker", robot="arm")


def _touches(path: Path) -> object:
    return read_touches(path.parent / "cell", path, robot="left", format="ros")


def read_damaged_tables(chance: Random, folder: Path) -> str:
    """A dataset of LeRobot, its description or its table damaged."""
    if find_spec("pyarrow") is None:
        return "no pyarrow"
    write_damaged_tables(chance, folder)
    return run_reader(lambda: read_episode(folder, chance.choice([0, 0, 1])))


def write_damaged_tables(chance: Random, folder: Path) -> Path:
    """Write such a dataset; its table."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    (folder / "meta").mkdir()
    (folder / "data").mkdir()
    feature = {"features": {"observation.state": {"names": ["a.pos", "b.pos"]}}}
    (folder / "meta" / "info.json").write_text(
        json.dumps(damaged(feature, chance) if chance.random() < 0.3 else feature)
    )
    rows = 2 ** chance.randint(0, 18)
    states = pa.ListArray.from_arrays(np.arange(0, 2 * rows + 1, 2, dtype=np.int32), np.zeros(2 * rows))
    columns = [states, np.zeros(rows), np.zeros(rows, np.int64)]
    table = pa.table(columns, names=["observation.state", "timestamp", "episode_index"])
    path = folder / "data" / "a.parquet"
    pq.write_table(table, path, compression=chance.choice(["none", "zstd", "snappy"]))
    content = path.read_bytes()
    at = chance.choice([0, len(content) // 2, max(len(content) - 400, 0)])  # at its end it says what it holds
    if chance.random() < _TORN:
        path.write_bytes(content[:at] + torn_bytes(content[at:], chance))
    return path


def read_damaged_film(chance: Random, folder: Path) -> str:
    """A film of LeRobot: it, what describes it, or the table of its episodes is damaged."""
    if find_spec("pyarrow") is None:
        return "no pyarrow"
    import pyarrow as pa
    import pyarrow.parquet as pq

    key, strange = "observation.images.wrist", chance.random()
    (folder / "meta" / "episodes").mkdir(parents=True)
    features: object = {"features": {key: {"dtype": "video"}, "observation.state": {"names": ["a.pos"]}}}
    (folder / "meta" / "info.json").write_text(json.dumps(damaged(features, chance) if strange < 0.2 else features))
    numbers = [chance.choice([0.0, -1.0, 1e300, 0.5, 1e9]) if 0.2 < strange < 0.4 else 0.0 for _ in range(3)]
    names = [f"videos/{key}/{name}" for name in ("chunk_index", "file_index", "from_timestamp")]
    row = dict(zip(names, numbers, strict=True)) | {"episode_index": 0}
    pq.write_table(pa.Table.from_pylist([row]), folder / "meta" / "episodes" / "a.parquet")
    path = folder / "videos" / key / "chunk-000" / "file-000.mp4"
    path.parent.mkdir(parents=True)
    path.write_bytes(torn_bytes(_FILM.read_bytes(), chance) if strange > 0.3 else _FILM.read_bytes())
    return run_reader(lambda: write_images(find_film(folder, 0, None), np.array([0.0, 0.5]), folder))


FOREIGN: dict[str, Trial] = {
    "workbook": read_damaged_workbook,
    "arrays": _of_data(
        {name: np.tile(np.eye(3), (3, 1, 1)).tolist() for name in ("R_gripper2base", "R_target2cam")}
        | {"t_gripper2base": np.zeros((3, 3)).tolist(), "t_target2cam": np.ones((3, 3)).tolist()},
        "a.json",
        lambda path: read_record_of_arrays(path, None, 1.0),
    ),
    "joints": _of_texts(
        {"a.csv": b",".join(b"joint_%d" % k for k in range(1, 7)) + b"\n0,-90,90,0,20,0\n10,-80,80,5,20,-5\n"}, _joints
    ),
    "points": _of_texts({"a.csv": b"sample,target,x_mm,y_mm,z_mm\n0,ball,1.5,2,3\n1,ball,4,5,6\n"}, _points),
    "touches": _of_texts({"a.csv": b"x,y,z,qx,qy,qz,qw,mark\n0.4,0,0.5,0,0,0,1,a\n0.5,0.1,0.4,1,0,0,0,b\n"}, _touches),
    "easy-handeye": _of_data(
        {"parameters": {"calibration_type": "eye_on_base"}, "samples": [{"robot": _POSE, "tracking": _POSE}]},
        "a.samples",
        read_easy_handeye_record,
    ),
    "easy-handeye result": _of_data(
        {"parameters": {"eye_on_hand": True, "robot_base_frame": "b"}, "transformation": _FLAT},
        "a",
        read_easy_handeye_record,
    ),
    "moveit-samples": _of_data(
        [{"effector_wrt_world": np.eye(4).ravel().tolist(), "object_wrt_sensor": np.eye(4).tolist()}], "a", _moveit
    ),
    "moveit joints": _of_data({"joint_names": ["a", "b"], "joint_values": [[0.1, 0.2], [0.3, 0.4]]}, "a", _moveit),
    "industrial": _of_data(
        {
            "data": [{"image": "0.png", "pose": "0.yaml"}],
            "intrinsics": _LENS,
            "static_camera": True,
            "camera_mount_to_camera_guess": _FLAT,
            "target_finder": {"type": "ModifiedCircleGridTargetFinder", "rows": 9, "cols": 10, "spacing": 0.0254},
        },
        "cal_data.yaml",
        _data_set,
    ),
    "camera-info": _of_data(
        {
            "image_width": 1280,
            "image_height": 720,
            "camera_matrix": {"rows": 3, "cols": 3, "data": _MATRIX},
            "distortion_model": "plumb_bob",
            "distortion_coefficients": {"data": [-0.35, 0.179, 0.0, 0.0, 0.0]},
            "roi": {"width": 0, "height": 0},
        },
        "a.yaml",
        read_camera_info,
    ),
    "kalibr": _of_data({"cam1": _CAMERA}, "a.yaml", read_camchain),
    "kalibr target": _of_data(
        {"target_type": "aprilgrid", "tagCols": 6, "tagRows": 5, "tagSize": 0.088, "tagSpacing": 0.3}, "a", read_target
    ),
    "opencv": _of_data(
        {"camera_matrix": _MATRIX, "dist": [0.1, 0, 0, 0], "image_size": [1280, 720]}, "a", read_opencv_lens
    ),
    "opencv storage": _of_texts({"a.xml": _XML.encode(), "a.yml": _YAML.encode()}, read_opencv_lens),
    "colmap": _of_texts(
        {"cameras.bin": _COLMAP, "cameras.txt": b"1 OPENCV 640 480 600 601 320 240 0.1 0 0 0\n"}, read_colmap_lenses
    ),
    "colmap images": _of_texts(
        {"images.bin": binary_images(IMAGES), "images.txt": text_images(IMAGES).encode()}, read_colmap_images
    ),
    "mrcal": _of_texts({"a.cameramodel": _MODEL.encode()}, read_cameramodel),
}
