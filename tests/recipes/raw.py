"""Raw input files of each recipe, by the name of its page."""

from __future__ import annotations

import runpy
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from shutil import copytree, ignore_patterns

import numpy as np
from scipy.spatial.transform import Rotation

from basecal.cell import Recording, Sample
from basecal.cell.files import read_recording
from basecal.cell.targets.charuco import charuco_target
from basecal.geometry import SE3
from basecal.simulation import SimulatedCell
from basecal.simulation.images import render_recording
from tests.film_dataset import write_dataset
from tests.journeys.raw import FIRST_STAMP_NS, cell, photographs, recorded, written
from tests.journeys.test_hobby_arms import OFFSET_DEG, dataset, frame_name
from tests.journeys.test_production import krl, rapid
from tests.journeys.test_ros2 import PERIOD_NS, trajectory
from tests.journeys.test_ur import teach_pendant
from tests.recipes import touching

OF_ARMS = (("eye", "left"), ("hand", "right"))


def ur(folder: Path) -> None:
    """Poses of two arms and photographs."""
    made = cell(samples=15, seed=3)
    photographs(made, folder, lambda i: f"IMG_{i + 1}.png")
    for robot, name in OF_ARMS:
        written(folder / f"{name}.txt", teach_pendant(*recorded(made, robot)))


def readme(folder: Path) -> None:
    """A shipped example, and the raw files of the recipe for UR arms."""
    example = Path(__file__).parents[2] / "examples" / "ur5e_dual"
    copytree(example, folder / "examples" / "ur5e_dual", ignore=ignore_patterns("runs", "derived"))
    ur(folder)


def kuka_abb(folder: Path) -> None:
    """Lines of two pendants' programs, and images."""
    made = cell(samples=18, seed=5)
    photographs(made, folder, lambda i: f"cam0_{i + 1:04d}.png")
    written(folder / "calib.dat", krl(*recorded(made, "eye")))
    written(folder / "calib.mod", rapid(*recorded(made, "hand")))


def ros2(folder: Path) -> None:
    """Trajectories, and images whose names are stamps."""
    made = cell(samples=15, seed=11)
    photographs(made, folder, lambda i: f"{FIRST_STAMP_NS + i * PERIOD_NS}.png")
    for robot, name in OF_ARMS:
        written(folder / f"{name}.txt", trajectory(*recorded(made, robot)))


def lerobot(folder: Path) -> None:
    """Episodes of two arms with joint offsets, and frames."""
    made = cell(samples=40, seed=1, joints=True, joint_offset_rad=np.radians(OFFSET_DEG), robot_noise=(0.0, 0.0))
    photographs(made, folder, frame_name)
    for robot, name in (("eye", "leader"), ("hand", "follower")):
        dataset(made, robot, folder / name)


def two_cameras(folder: Path) -> None:
    """Two arms with a camera each; both observe one board in every sample."""
    made = cell(samples=15, seed=4, layout="two_cameras")
    for robot in ("left", "right"):
        written(folder / f"{robot}.txt", teach_pendant(*recorded(made, robot)))
    recording = render_recording(made, folder / "rendered")
    for camera in made.cell.cameras:
        name = f"photos_{made.cell.cameras[camera].on}"
        (folder / name).mkdir()
        for i, sample in enumerate(recording.samples):
            (folder / "rendered" / sample.images[camera]).rename(folder / name / f"{i + 1}.png")


def camera_beside(folder: Path) -> None:
    """One arm that moves a board in front of a camera on a tripod."""
    made = cell(samples=18, seed=6, layout="eye_to_hand")
    photographs(made, folder, lambda i: f"{i + 1}.png")
    written(folder / "arm.txt", teach_pendant(*recorded(made, "arm")))


def three_robots(folder: Path) -> None:
    """Two cameras, each with images of its own samples, which tables name."""
    made = _with_another_board(cell(samples=45, seed=7, layout="chain"), "r3")
    pairs = [("r1", "r2"), ("r2", "r3")]
    on = {name: camera.on for name, camera in made.cell.cameras.items()}
    kept = [
        sample
        for sample in made.recording.samples
        if any((on[o.camera], made.cell.targets[o.target].on) in pairs for o in sample.observations)
    ]
    images = render_recording(made, folder / "rendered")
    names = {}
    for carrier, called in (("r1", "photos_left"), ("r2", "photos_middle")):
        (folder / called).mkdir()
        mine = [s for s in kept if any(on[o.camera] == carrier for o in s.observations)]
        for sample in mine:
            (path,) = images.samples[sample.sample].images.values()
            names[sample.sample] = f"{called[7:]}_{sample.sample:03d}.png"
            (folder / "rendered" / path).rename(folder / called / names[sample.sample])
    for robot, called in (("r1", "left"), ("r2", "middle"), ("r3", "right")):
        some = [sample for sample in kept if robot in sample.robots]
        positions, turns = recorded(_of(made, some), robot)
        rows = np.column_stack([positions, turns.as_rotvec()])
        lines = [
            f"{names[sample.sample]}," + ",".join(f"{number:.9g}" for number in row)
            for sample, row in zip(some, rows, strict=True)
        ]
        written(folder / f"{called}.csv", ["image,x,y,z,rx,ry,rz", *lines])


def _with_another_board(made: SimulatedCell, robot: str) -> SimulatedCell:
    other = charuco_target((5, 7), 0.03, 0.0225, "DICT_5X5_50")
    targets = {n: replace(t, target=other) if t.on == robot else t for n, t in made.cell.targets.items()}
    return replace(made, cell=replace(made.cell, targets=targets))


def _of(made: SimulatedCell, samples: list) -> SimulatedCell:  # type: ignore[type-arg]
    return replace(made, recording=Recording(tuple(samples)))


def tutorial(folder: Path) -> None:
    """Recordings of the same cell on two days, between which no part has moved."""
    made = cell(samples=24, seed=8)
    first, later = made.recording.samples[:20], made.recording.samples[20:]
    photographs(made, folder, lambda i: f"{i + 1:02d}.png")
    (folder / "photos_today").mkdir()
    for image in sorted((folder / "photos").iterdir())[20:]:
        image.rename(folder / "photos_today" / image.name)
    for robot, name in OF_ARMS:
        written(folder / f"{name}.txt", teach_pendant(*recorded(_of(made, list(first)), robot)))
        written(folder / f"{name}_today.txt", teach_pendant(*recorded(_of(made, list(later)), robot)))


def scene(folder: Path) -> None:
    """Poses of two arms, and images of a table without a target from both cameras."""
    program = runpy.run_path(str(Path(__file__).parents[2] / "examples" / "scene" / "make.py"))
    program["make"](folder / "rendered_scene", views=14, size=(400, 300))
    made = folder / "rendered_scene"
    samples = read_recording(made).samples
    for robot in ("left", "right"):
        (folder / f"photos_{robot}").mkdir()
        mine = [sample for sample in samples if robot in sample.robots]
        poses = SE3.stack([sample.robots[robot].base_from_flange for sample in mine])
        written(folder / f"{robot}.txt", teach_pendant(poses.translation, Rotation.from_matrix(poses.rotation)))
        for i, sample in enumerate(mine):
            (made / sample.images[f"{robot}_eye"]).rename(folder / f"photos_{robot}" / f"{i + 1}.png")
    arms = {}
    for robot in ("left", "right"):
        mine = [sample for sample in samples if robot in sample.robots]
        poses = SE3.stack([sample.robots[robot].base_from_flange for sample in mine])
        arms[robot] = poses, [folder / f"photos_{robot}" / f"{i + 1}.png" for i in range(len(mine))]
    write_dataset(folder / "dataset", folder / "arm.urdf", arms)
    scene_bag(folder, {robot: [s for s in samples if robot in s.robots] for robot in ("left", "right")})


def scene_bag(folder: Path, samples: dict[str, list[Sample]]) -> None:
    """A bag of the same scene: both arms stop simultaneously for each image, and move on."""
    from tests.bag_of_cell import BagWriter, between, journey, middles

    bag = BagWriter("mcap", folder / "recording")
    for robot, mine in samples.items():
        poses = SE3.stack([sample.robots[robot].base_from_flange for sample in mine])
        for time, stop, share in journey(len(mine)):
            bag.pose(f"/{robot}/pose", time, between(poses, stop, share))
        for k, time in enumerate(middles(len(mine))):
            image = (folder / f"photos_{robot}" / f"{k + 1}.png").read_bytes()
            for late in (-0.2, 0.0, 0.2):
                bag.compressed(f"/{robot}_eye/image/compressed", float(time) + late, image, "png")
    bag.close()


def nothing(folder: Path) -> None:
    """A page without raw files."""


RAW: dict[str, Callable[[Path], None]] = {
    "README": readme,
    "ur": ur,
    "kuka_abb": kuka_abb,
    "ros2": ros2,
    "lerobot": lerobot,
    "two_cameras": two_cameras,
    "camera_beside": camera_beside,
    "three_robots": three_robots,
    "led_shifts": nothing,
    "scene": scene,
    "touches": touching.touches,
    "tracker": touching.tracker,
    "tutorial": tutorial,
}
