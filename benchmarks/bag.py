"""Memory that an import of a long bag takes: of a tenth of it and of all, by stops and as streams.

An arm moves from stop to stop for minutes. rosbags writes its pose 50 times a second, and 30 times a second an image of
1280 x 720 with noise. `basecal import bag` reads the bag in a separate process.

    python -m benchmarks.bag --gigabytes 2
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from basecal.geometry import SE3
from benchmarks.common import table, write

KINDS = ("ros1", "mcap", "sqlite3")
SIZE_PX, IMAGES_HZ, POSES_HZ = (1280, 720), 30, 50
STOP_S, MOVE_S = 1.0, 0.6
BEGIN_S = 1_700_000_000.0
SHORT_SHARE = 0.1  # of the size of the long bag
HEAD = ("bag", "GB", "taken", "lines", "peak memory [MB]", "s")
GIGABYTES = 2.0


def write_bag(path: Path, kind: str, gigabytes: float) -> Path:
    """Write a bag of a size message by message, and return its path."""
    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    path = path.with_suffix(".bag") if kind == "ros1" else path
    writer: Any = Writer1(path) if kind == "ros1" else Writer2(path, version=9, storage_plugin=plugin)
    serialize = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr
    rng, image, pose = np.random.default_rng(0), "sensor_msgs/msg/Image", "geometry_msgs/msg/PoseStamped"
    seconds = gigabytes * 1e9 / (SIZE_PX[0] * SIZE_PX[1] * IMAGES_HZ)
    with writer:
        images = writer.add_connection("/wrist/image_raw", image, typestore=store)
        poses = writer.add_connection("/arm/pose", pose, typestore=store)
        for k in range(int(seconds * POSES_HZ)):
            time_s = k / POSES_HZ
            stamp = round((BEGIN_S + time_s) * 1e9)
            writer.write(poses, stamp, serialize(pose_message(store, kind, time_s), pose))
            if (k * IMAGES_HZ) // POSES_HZ != ((k + 1) * IMAGES_HZ) // POSES_HZ:
                pixels = rng.integers(0, 256, SIZE_PX[0] * SIZE_PX[1], dtype=np.uint8)
                header = make_header(store, kind, time_s)
                shape = (SIZE_PX[1], SIZE_PX[0], "mono8", 0, SIZE_PX[0])
                writer.write(images, stamp, serialize(store.types[image](header, *shape, pixels), image))
    return path


def make_header(store: Any, kind: str, time_s: float) -> Any:
    whole, part = divmod(round((BEGIN_S + time_s) * 1e9), 10**9)
    stamp = store.types["builtin_interfaces/msg/Time"](whole, part)
    return store.types["std_msgs/msg/Header"](*((0,) if kind == "ros1" else ()), stamp, "camera")


def pose_message(store: Any, kind: str, time_s: float) -> Any:
    """Pose of an arm that moves from one stop to the next."""
    stop, within_s = divmod(time_s, STOP_S + MOVE_S)
    progress = stop + max(0.0, within_s - STOP_S) / MOVE_S
    pose = SE3.exp(np.array([0.1 * progress, 0.2, 0.5, 0.1 * progress, 0.0, 0.0]))
    point = store.types["geometry_msgs/msg/Point"](*map(float, pose.translation))
    turn = store.types["geometry_msgs/msg/Quaternion"](*map(float, pose.quaternion))
    inner = store.types["geometry_msgs/msg/Pose"](point, turn)
    return store.types["geometry_msgs/msg/PoseStamped"](make_header(store, kind, time_s), inner)


def import_bag(cell: Path, bag: Path, streams: bool) -> tuple[int, float, float]:
    """Lines of the recording, the peak memory of the importing process [MB], and its time [s]."""
    words = [sys.executable, "-m", "basecal", "import", "bag", str(cell), str(bag), "--robot", "arm=/arm/pose"]
    began = time.perf_counter()
    process = subprocess.Popen([*words, *(["--streams"] if streams else [])], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    took = time.perf_counter() - began
    if status:
        raise SystemExit(f"import bag ended with {os.waitstatus_to_exitcode(status)}")
    lines = (cell / "recording" / "samples.jsonl").read_text(encoding="utf-8").count("\n")
    return lines, used.ru_maxrss / 1e3, took


def measure(kind: str, gigabytes: float) -> list[list[object]]:
    """Rows of the table for one kind of bag."""
    rows: list[list[object]] = []
    for share in (SHORT_SHARE, 1.0):
        with tempfile.TemporaryDirectory() as folder:
            bag = write_bag(Path(folder) / "recording", kind, share * gigabytes)
            for streams in (False, True):
                cell = Path(folder) / f"cell{int(streams)}"
                lines, peak_mb, took = import_bag(cell, bag, streams)
                taken = "streams" if streams else "stops"
                rows.append([kind, round(share * gigabytes, 2), taken, lines, round(peak_mb), round(took, 1)])
    return rows


def main(arguments: list[str]) -> None:
    """Measure and print; with all of the size and all kinds write results/bag.json too."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.bag", description=__doc__.splitlines()[0])
    parser.add_argument("--gigabytes", type=float, default=GIGABYTES)
    parser.add_argument("--kinds", nargs="+", default=list(KINDS))
    asked = parser.parse_args(arguments)
    rows = [row for kind in asked.kinds for row in measure(kind, asked.gigabytes)]
    print(table(HEAD, rows))
    if asked.gigabytes >= GIGABYTES:
        write("bag", {"rows": rows, "size_px": SIZE_PX})


if __name__ == "__main__":
    main(sys.argv[1:])
