"""The slips, and the messages that each requires."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from benchmarks.slips import images, poses, statements, tags
from benchmarks.slips.desk import Desk


class Slip(NamedTuple):
    """A slip.

    Attributes:
        number: Number in the list of slips; a letter distinguishes slips with one number.
        words: Description for users.
        spoil: Function that applies it to a desk.
        cause: Pattern of the sentence that names the cause; empty if everything must work.
        cure: Pattern of the cure.
        fix: Whether `basecal fix` can undo it in the files.
    """

    number: str
    words: str
    spoil: Callable[[Desk], None]
    cause: str = ""
    cure: str = ""
    fix: bool = False


SLIPS = (
    Slip("1a", "centre of a fixed lens 4 to 25 px off", statements.shifted_centre, r"centre|principal", r"free", True),
    Slip("1b", "distortion left at zero", statements.no_distortion, r"lens of wrist", r"free", True),
    Slip(
        "2",
        "base or mount fixed from CAD, 1 to 23 mm off",
        statements.from_cad,
        r"stated (base|mount) of .* disagrees",
        r"measure .* again.*basecal fix",
        True,
    ),
    Slip(
        "3a", "sigmas 1000 times too small", statements.tiny_sigmas, r"stated noise of ur is", r"state noise of", False
    ),
    Slip("3b", "sigmas in mm and degrees", statements.sigmas_in_mm, r"stated noise of ur is", r"state noise of", False),
    Slip(
        "4",
        "pendant set to RPY, read as a rotation vector",
        poses.rpy_as_rotvec,
        r"rotations of ur are roll, pitch, yaw",
        r"turn them into",
        True,
    ),
    Slip(
        "5a",
        "columns in the order C, B, A",
        poses.reversed_angles,
        r"angles of kuka are in the reverse order",
        r"turn them|--format",
        True,
    ),
    Slip("5b", "KUKA's angles read as FANUC's", poses.as_fanuc, r"KUKA", r"turn them|--format kuka", True),
    Slip("6a", "KUKA's file as of UR", poses.kuka_as_ur, r"look like millimetres and degrees", r"--format kuka"),
    Slip("6b", "UR's file as of KUKA", poses.ur_as_kuka, r"look like metres and radians", r"--format ur"),
    Slip("7", "matrices transposed", poses.transposed, r"transposed", r"--format franka"),
    Slip(
        "8",
        "rows in the order 1, 10, 11, 2",
        poses.sorted_as_text,
        r"kuka recorded is sorted as text",
        r"sort it by number",
        True,
    ),
    Slip(
        "9",
        "two rows exchanged",
        poses.two_exchanged,
        r"poses of kuka at samples \d+ and \d+ are exchanged",
        r"exchange|fix",
        True,
    ),
    Slip(
        "10a",
        "two axes exchanged",
        poses.two_axes,
        r"positions of kuka have [xyz] and [xyz] exchanged",
        r"correct the order",
        True,
    ),
    Slip(
        "10b",
        "an axis with the wrong sign",
        poses.wrong_sign,
        r"positions of kuka have [xyz] with the wrong sign",
        r"correct",
        True,
    ),
    Slip(
        "11",
        "one file for both robots",
        poses.same_file,
        r"kuka and ur have identical poses",
        r"import the poses of kuka or ur again",
    ),
    Slip(
        "12a",
        "tool frame changed on the way",
        poses.tool_changed,
        r"from sample \d+ on the poses of kuka are of another tool frame",
        r"record|session|import",
    ),
    Slip(
        "12b",
        "base frame changed on the way",
        poses.base_changed,
        r"from sample \d+ on the poses of kuka are in another base frame",
        r"record|session|import",
    ),
    Slip(
        "13",
        "both robots recorded in one frame",
        poses.one_frame,
        r"bases of kuka and ur are .* apart",
        r"check the base frame",
    ),
    Slip(
        "14a",
        "target stated on the world",
        statements.target_on_world,
        r"board is on kuka, not on world",
        r"on: kuka",
        True,
    ),
    Slip(
        "14b",
        "target stated on the arm of the camera",
        statements.target_on_camera_arm,
        r"'?board'?.* on '?ur",
        r"on: kuka|--target-on",
    ),
    Slip("15", "images mirrored", images.mirrored, r"mirrored", r"turn|flip|mirror"),
    Slip("16", "a second board of the same numbers", images.second_board, r"seen twice", r"cover|remove"),
    Slip("17", "ChArUco described as a chessboard", images.as_chessboard, r"markers here|charuco", r"kind: charuco"),
    Slip("18", "images named under `Bild`, rows in another order", images.bild),
    Slip("19", "an image is missing", images.missing, r"007 missing in the numbering", r"column .image"),
    Slip(
        "20",
        "a few rows in millimetres",
        poses.few_rows_in_mm,
        r"(samples?|lines) .*looks? like millimetres",
        r"divide their lengths by 1000",
    ),
    Slip("21a", "decimal commas between commas", poses.decimal_commas, r"decimal comma", r"separator"),
    Slip("21b", "thousands separators", poses.thousands, r"thousands separator", r"remove the thousands separators"),
    Slip("21c", "an Excel file", poses.excel),
    Slip("22", "`--on ur5` for `ur`", statements.on_ur5, r"no robot '?ur5", r"did you mean '?ur"),
    Slip("23", "a column `image` beside matrices", poses.image_of_matrices),
    Slip("24", "Franka's matrices by rows", poses.franka_by_rows, r"by rows", r"--format matrix"),
    Slip("25", "inches", poses.inches, r"poses of kuka are in inches", r"--length-unit inch", True),
    Slip("26", "a lens in a YAML of their own", statements.own_yaml),
    Slip("27a", "an arm that stands still in one row", tags.still_arms),
    Slip("27b", "a second file of another length", tags.second_file),
    Slip("28", "ten detections at each stop", tags.ten_detections),
)
