"""Make `recording/samples.jsonl` from the published files.

    python examples/rct_charuco/make.py FOLDER

FOLDER holds poses/*.yaml and detections_derived.npz (corners found with OpenCV in the published images).
"""

import sys
from pathlib import Path

import numpy as np
from ruamel.yaml import YAML

from basecal import SE3, Recording, Sample, write_recording
from basecal.cell import PixelObservation, RobotState

COLUMNS = 5
SQUARE_M = 0.036195


def flange_pose(path: Path) -> SE3:
    """`hand_base_from_hand_flange` of one published file."""
    said = YAML(typ="safe").load(path)
    return SE3.from_quaternion([said[f"q{axis}"] for axis in "xyzw"], [said[axis] for axis in "xyz"])


def main(source: Path, cell: Path) -> None:
    """Write the recording of the cell in folder `cell` from the files in `source`; sample i is image i."""
    found = np.load(source / "detections_derived.npz")
    in_squares = np.round(found["object_points_m"] / SQUARE_M).astype(int)
    ids = (in_squares[:, 1] - 1) * (COLUMNS - 1) + in_squares[:, 0] - 1
    pixels = np.round(found["image_points"].astype(float), 4)
    samples = []
    for image in np.unique(found["image_index"]):
        mine = found["image_index"] == image
        seen = PixelObservation("camera", "board", ids[mine], pixels[mine])
        state = RobotState(base_from_flange=flange_pose(source / "poses" / f"{image}.yaml"))
        samples.append(Sample(int(image), robots={"hand": state}, observations=(seen,)))
    print(write_recording(Recording(tuple(samples)), cell))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(__file__).parent)
