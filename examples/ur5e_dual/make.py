"""Make `recording/samples.jsonl` from the published files.

    python examples/ur5e_dual/make.py FOLDER

FOLDER holds r1_tf.txt, r2_tf.txt and detections_derived.npz (corners found with OpenCV 4.14 in the published images).
"""

import sys
from pathlib import Path

import numpy as np

from basecal import write_recording
from basecal.exchange.controller_poses import read_poses
from basecal.exchange.streams import recording_from_streams

COLUMNS = 5


def main(source: Path, cell: Path) -> None:
    """Write the recording of the cell in folder `cell` from the files in `source`."""
    found = np.load(source / "detections_derived.npz")
    in_squares = np.round(found["object_points_squares"]).astype(int)
    ids = (in_squares[..., 1] - 1) * (COLUMNS - 1) + in_squares[..., 0] - 1
    pixels = np.round(found["image_points"].astype(float), 4)
    # The authors' text has the roles the other way round; only with r2 as the camera's robot does the loop close.
    robots = {
        "eye": read_poses(source / "r2_tf.txt", "m"),
        "hand": read_poses(source / "r1_tf.txt", "m"),
    }
    views = dict(enumerate(zip(ids, pixels, strict=True)))
    print(write_recording(recording_from_streams(robots, "camera", "board", pixels=views), cell))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(__file__).parent)
