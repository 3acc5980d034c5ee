"""Slips with poses of a tag from another detector."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from basecal.geometry import SE3, Array
from benchmarks.slips.desk import (
    CELL,
    KUKA_HEADER,
    SAMPLES,
    UR_HEADER,
    Desk,
    csv_rows,
    import_poses,
    kuka_rows,
    ur_rows,
)

HEADER = "x,y,z,qx,qy,qz,qw"
DETECTIONS = 10
TAG_NOISE = np.repeat([3e-4, 1e-3], 3)  # [m, rad] per axis of a detection
RecordedPoses = tuple[Array, Rotation]


def still_arms(desk: Desk) -> None:
    """Import two sessions of unequal length, in each of which one arm stands still and has one row."""
    ur, kuka, short = desk.ur, desk.kuka, SAMPLES - 3
    desk.write("ur_moves.csv", [UR_HEADER, *ur_rows(*ur)])
    desk.write("kuka_still.csv", [KUKA_HEADER, *kuka_rows(*_rows(kuka, slice(1)))])
    desk.write("tags_1.csv", [HEADER, *ros_rows(_detections(desk, _poses(ur), _poses(kuka)[0], 0))])
    desk.write("kuka_moves.csv", [KUKA_HEADER, *kuka_rows(*_rows(kuka, slice(short)))])
    desk.write("ur_still.csv", [UR_HEADER, *ur_rows(*_rows(ur, slice(1)))])
    desk.write("tags_2.csv", [HEADER, *ros_rows(_detections(desk, _poses(ur)[0], _poses(kuka)[:short], 1))])
    desk.steps = [
        import_poses("ur", file="ur_moves.csv"),
        import_poses("kuka", file="kuka_still.csv", options="--still"),
        _import_tags("tags_1.csv"),
        import_poses("kuka", file="kuka_moves.csv", options="--session"),
        import_poses("ur", file="ur_still.csv", options="--still"),
        _import_tags("tags_2.csv"),
    ]


def second_file(desk: Desk) -> None:
    """Import a second recording of another day with fewer rows."""
    ur, kuka = _poses(desk.ur), _poses(desk.kuka)
    desk.steps = []
    for name, part, options in (("monday", slice(9), ""), ("tuesday", slice(9, None), "--session")):
        desk.write(f"ur_{name}.csv", [UR_HEADER, *ur_rows(*_rows(desk.ur, part))])
        desk.write(f"kuka_{name}.csv", [KUKA_HEADER, *kuka_rows(*_rows(desk.kuka, part))])
        desk.write(f"tags_{name}.csv", [HEADER, *ros_rows(_detections(desk, ur[part], kuka[part], 0))])
        desk.steps += [
            import_poses("ur", file=f"ur_{name}.csv", options=options),
            import_poses("kuka", file=f"kuka_{name}.csv"),
            _import_tags(f"tags_{name}.csv"),
        ]


def ten_detections(desk: Desk) -> None:
    """Import ten detections of each stop under the number of its sample."""
    each = [_detections(desk, _poses(desk.ur), _poses(desk.kuka), k) for k in range(DETECTIONS)]
    rows = [ros_rows(poses) for poses in each]
    lines = [f"{sample},{rows[k][sample]}" for sample in range(SAMPLES) for k in range(DETECTIONS)]
    desk.write("tags.csv", [f"sample,{HEADER}", *lines])
    desk.steps[2] = _import_tags("tags.csv")


def ros_rows(poses: SE3) -> list[str]:
    """Rows of positions in metres and quaternions with w last."""
    return csv_rows(np.c_[poses.translation, Rotation.from_matrix(poses.rotation).as_quat()], 7)


def _import_tags(file: str) -> str:
    return f"basecal import poses {CELL} {file} --camera wrist --target tag --on ur --target-on kuka --format ros"


def _rows(recorded: RecordedPoses, part: slice) -> RecordedPoses:
    return recorded[0][part], recorded[1][part]


def _poses(recorded: RecordedPoses) -> SE3:
    return SE3(recorded[1].as_matrix(), recorded[0])


def _detections(desk: Desk, ur: SE3, kuka: SE3, session: int) -> SE3:
    """Detected camera_from_tag, with noise; recorded poses of the arms are close enough to the true ones."""
    rng = np.random.default_rng([desk.draw, session, 7])
    truth = desk.made.truth
    eye = ur @ truth[desk.made.cell.mount_name(next(iter(desk.made.cell.cameras)))]
    (base,) = desk.truth.values()
    tag = base @ kuka @ truth[desk.made.cell.mount_name(next(iter(desk.made.cell.targets)))]
    seen = eye.inverse() @ tag
    return seen @ SE3.exp(rng.normal(size=(*seen.translation.shape[:-1], 6)) * TAG_NOISE)
