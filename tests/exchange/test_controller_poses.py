"""Tests of files of flange poses as controllers write them, including makers' own examples."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.shared.real_recordings import data_folder

from basecal.errors import DatasetError, InputError
from basecal.exchange.controller_poses import (
    PoseFormat,
    _other_controllers,
    column_unit,
    guessed_format,
    keyed_rows,
    read_controller_poses,
    read_pose_rows,
    read_poses,
)
from basecal.exchange.controllers.convention import DEGREE, RADIAN
from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.exchange.importing.text_table import read_text_table
from basecal.geometry import SE3


def poses(folder: Path, text: str, reading: PoseFormat, name: str = "poses.txt") -> SE3:
    (folder / name).write_text(text, encoding="utf-8")
    rows = read_controller_poses(str(folder / name), "left", reading)
    found = [row.robots["left"].base_from_flange for row in rows]
    return SE3.stack([pose for pose in found if pose is not None])


def by_angles(axes: str, *degrees: float) -> Rotation:
    """Return one rotation. SciPy up to 1.15 makes a stack of one from a single axis and a list of one angle."""
    return Rotation.from_euler(axes, degrees if len(axes) > 1 else degrees[0], degrees=True)


# Text from a document, and the pose that the document states for it.
EXAMPLES = {
    # The URScript Programming Language: rotvec2rpy([3.14, 1.57, 0]) is [-2.80856, -0.16202, 0.9].
    "ur": (
        "p[0.1, 0.2, 0.3, 3.14, 1.57, 0]",
        [0.1, 0.2, 0.3],
        by_angles("xyz", *np.degrees([-2.80856, -0.16202, 0.9])),
    ),
    # RAPID Technical reference manual: robtarget p15; and orient: 30 deg about y are [0.965926, 0, 0.258819, 0].
    "abb": (
        "CONST robtarget p15 := [ [600, 500, 225.3], [0.965926, 0, 0.258819, 0], [1, 1, 0, 0], "
        "[ 11, 12.3, 9E9, 9E9, 9E9, 9E9] ];",
        [0.6, 0.5, 0.2253],
        by_angles("y", 30),
    ),
    # industrial_robot_angle_conversions, test of fanucWPRtoQuaternion.
    "fanuc": (
        "100 200 300 -50 125 67",
        [0.1, 0.2, 0.3],
        Rotation.from_quat([-0.606432, 0.562658, 0.543574, 0.142067]),
    ),
    # RoboDK's KUKA_2_Pose is its Fanuc_2_Pose with the angles in reverse order; the numbers as above.
    "kuka": (
        "DECL E6POS XP1={X 1620.0,Y 0.0,Z 1910.0,A 67.0,B 125.0,C -50.0,S 2,T 35,E1 0.0}",
        [1.62, 0, 1.91],
        Rotation.from_quat([-0.606432, 0.562658, 0.543574, 0.142067]),
    ),
    # RoboDK's Pose_2_Staubli is rotx roty rotz; numbers: industrial_robot_angle_conversions, RPYtoQuaternion, x y z.
    "staubli": (
        "x y z rx ry rz\n100 200 300 20 86 32",
        [0.1, 0.2, 0.3],
        Rotation.from_quat([0.307207, 0.610614, 0.312366, 0.659699]),
    ),
    # mathworks.com, eul2rotm, the example of "ZYZ" with [0 pi/2 pi/2].
    "doosan": (
        "posx(100, 200, 300, 0, 90, 90)",
        [0.1, 0.2, 0.3],
        Rotation.from_matrix([[0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    ),
    # libfranka: column-major, metres; the start pose of its examples by its maker's DH parameters.
    "franka": (
        "[1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0.3069, 0, 0.4869, 1]",
        [0.3069, 0, 0.4869],
        by_angles("x", 180),
    ),
    # UFACTORY's user manual: Rz(yaw) Ry(pitch) Rx(roll).
    "xarm": ("300, 0, 300, 180, 20, 30", [0.3, 0, 0.3], by_angles("Z", 30) * by_angles("Y", 20) * by_angles("X", 180)),
    # DX100, "Configuration of Position Data": rotated in the order Rz, Ry and Rx.
    "yaskawa": (
        "1000.0,0.0,800.0,180.0000,-5.0000,30.0000",
        [1, 0, 0.8],
        by_angles("Z", 30) * by_angles("Y", -5) * by_angles("X", 180),
    ),
    # geometry_msgs/Quaternion: the scalar last.
    "ros": ("0.1 0.2 0.3 0 0.258819 0 0.965926", [0.1, 0.2, 0.3], by_angles("y", 30)),
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_documented_controller_examples_are_read(tmp_path: Path, name: str) -> None:
    """A line from a maker's document gives the pose stated there."""
    text, translation, rotation = EXAMPLES[name]
    pose = poses(tmp_path, text + "\n", PoseFormat(name))[0]
    np.testing.assert_allclose(pose.rotation, rotation.as_matrix(), atol=1e-5)
    np.testing.assert_allclose(pose.translation, translation, atol=1e-12)


# Complete programs, as KUKA's WorkVisual, ABB's RobotStudio and UR's PolyScope save them.
KUKA_DAT = """&ACCESS RVP
&REL 12
&PARAM EDITMASK = *
&PARAM TEMPLATE = C:\\KRC\\Roboter\\Template\\vorgabe
DEFDAT  CALIB PUBLIC
;FOLD EXTERNAL DECLARATIONS;%{PE}%MKUKATPBASIS,%CEXT,%VCOMMON,%P
;FOLD BASISTECH EXT;%{PE}%MKUKATPBASIS,%CEXT,%VEXT,%P
EXT  BAS (BAS_COMMAND  :IN,REAL  :IN )
DECL INT SUCCESS
;ENDFOLD (BASISTECH EXT)
;ENDFOLD (EXTERNAL DECLARATIONS)
DECL BASIS_SUGG_T LAST_BASIS={POINT1[] "P3                      ",POINT2[] "P3  ",CP_VEL[] "2  "}
DECL E6AXIS XHOME={A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 45.0,A6 0.0,E1 0.0,E2 0.0}
DECL FRAME P1={X 1.0,Y 400.0,Z 655.0,A 12.4,B 3.1,C 178.2}
DECL E6POS XP2={X 2.0,Y 401.5,Z 655.0,A 12.4,B 3.1,C 178.2,S 6,T 27,E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}
DECL FDAT FP2={TOOL_NO 1,BASE_NO 0,IPO_FRAME #BASE,POINT2[] " ",TQ_STATE FALSE}
DECL PDAT PPDAT2={VEL 100.000,ACC 100.000,APO_DIST 100.000,APO_MODE #CDIS,GEAR_JERK 50.0000,EXAX_IGN 0}
DECL LDAT LCPDAT2={VEL 2.00000,ACC 100.000,APO_DIST 100.000,APO_FAC 50.0000,ORI_TYP #VAR,CIRC_TYP #BASE}
ENDDAT
"""
KUKA_SRC = """DEF CALIB( )
$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}
$TOOL = {X 0,Y 0,Z 0,A 0,B 0,C 0}
$VEL.CP=0.05
PTP {A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 0.0,A6 0.0}
PTP {X 1.0,Y 400.0,Z 655.0,A 12.4,B 3.1,C 178.2,S 2,T 35}
LIN {X 2.0,Y 401.5,Z 655.0,A 12.4,B 3.1,C 178.2} C_DIS
WAIT SEC 0.5
END
"""
ABB_MOD = """%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE Calib
    PERS tooldata tCam:=[TRUE,[[0,0,207.5],[1,0,0,0]],[35.1,[-43.8,-5.8,88.2],[1,0,0,0],1.89,2.404,2.185]];
    TASK PERS wobjdata wobjTable:=[FALSE,TRUE,"",[[798.63,105.26,-26.8],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
    PERS loaddata load1:=[5,[50,0,50],[1,0,0,0],0,0,0];
    CONST speeddata vSlow:=[100,100,5000,1000];
    CONST jointtarget jHome:=[[91.0,-9.3,66.3,-1.0,-62.2,42.6],[9E9,9E9,9E9,9E9,9E9,9E9]];
    ! the places of calibration
    CONST robtarget p10:=[[1,400,655],[0,0.6,0.8,0],[0,-1,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
    VAR num count:=0;
    PROC main()
        ConfL\\Off;
        MoveAbsJ jHome\\NoEOffs,v100,fine,tool0;
        MoveL p10,v100,fine,tool0\\WObj:=wobj0;
        MoveL Offs(p10,0,0,100),v100,fine,tool0;
        MoveL [[2,401.5,655],[0,0.6,0.8,0],[0,0,-2,0],[9E9,9E9,9E9,9E9,9E9,9E9]]\\ID:=1,v100,fine,tool0;
        WaitTime 0.5;
        SetDO DO10_4,1;
    ENDPROC
ENDMODULE
"""
UR_SCRIPT = """def calib():
  set_tcp(p[0.0,0.0,0.1,0.0,0.0,0.0])
  set_payload(1.5, [0.0, 0.0, 0.05])
  global Waypoint_1_p=p[.001, .4, .655, 2.0, 0.1, 0.2]
  global Waypoint_1_q=[-1.6, -1.7, -2.2, -0.8, 1.6, 0.0]
  movel(p[.002, .4015, .655, 2.0, 0.1, 0.2], a=1.2, v=0.25)
end
"""


@pytest.mark.parametrize(
    ("name", "text"), [("kuka", KUKA_DAT), ("kuka", KUKA_SRC), ("abb", ABB_MOD), ("ur", UR_SCRIPT)]
)
def test_poses_of_controller_programs_are_read(tmp_path: Path, name: str, text: str) -> None:
    """The poses of a whole program are read, without its joints, tools, work objects, loads or speeds."""
    read = poses(tmp_path, text, PoseFormat(name))
    np.testing.assert_allclose(read.translation, [[0.001, 0.4, 0.655], [0.002, 0.4015, 0.655]], atol=1e-12)


@pytest.mark.parametrize("name", CONTROLLERS)
@pytest.mark.parametrize("with_header", [True, False])
def test_every_controller_format_is_read(tmp_path: Path, name: str, with_header: bool) -> None:
    """Rows of each controller's numbers give the poses back, with a header of its names, without one, and in mm."""
    drawn = SE3.exp(np.random.default_rng(0).normal(0, 0.6, (6, 6)))
    how = CONTROLLERS[name]
    lines = [";".join(repr(float(value)).replace(".", ",") for value in row) for row in how.to_numbers(drawn)]
    text = "\n".join([*([";".join(how.names)] if with_header else []), *lines])
    np.testing.assert_allclose(poses(tmp_path, text, PoseFormat(name)).matrix, drawn.matrix, atol=1e-12)
    read = poses(tmp_path, text, PoseFormat(name, how.length * 1e-3))
    np.testing.assert_allclose(read.translation * 1000, drawn.translation, atol=1e-9)


def test_columns_by_name_in_any_order(tmp_path: Path) -> None:
    """The header determines the columns, in any case and with units; other columns are ignored."""
    text = "image;C [deg];B_deg;A/°;Z [mm];y/mm;X in mm;speed\na.png;30;20;10;3;2;1;5\n"
    read = poses(tmp_path, text, PoseFormat("kuka"))
    np.testing.assert_allclose(read.translation, [[1e-3, 2e-3, 3e-3]])
    expected = Rotation.from_euler("ZYX", [10, 20, 30], degrees=True).as_matrix()
    np.testing.assert_allclose(read.rotation[0], expected, atol=1e-12)


def test_quaternion_columns_are_read_by_name(tmp_path: Path) -> None:
    """A format with the scalar first still reads a column named qw as the scalar."""
    text = "qx,qy,qz,qw,x,y,z\n0,0,0.6,0.8,1,2,3\n"
    for name in ("abb", "ros"):
        read = poses(tmp_path, text, PoseFormat(name, 1.0))
        np.testing.assert_allclose(read.quaternion, [[0, 0, 0.6, 0.8]], atol=1e-12)


def test_stated_units_override_format(tmp_path: Path) -> None:
    """Metres and radians may be stated for a controller that writes millimetres and degrees."""
    text = "0.1,0.2,0.3,0.4,0.5,0.6\n"
    read = poses(tmp_path, text, PoseFormat("fanuc", 1.0, 1.0))
    np.testing.assert_allclose(read.rpy, [[0.4, 0.5, 0.6]])
    np.testing.assert_allclose(read.translation, [[0.1, 0.2, 0.3]])
    assert PoseFormat("fanuc", 1.0, 1.0).words == "X, Y, Z, W, P, R: m, angles about fixed x, y, z in rad"
    assert PoseFormat("abb").words == "x, y, z, q1, q2, q3, q4: mm, quaternion, scalar first"
    assert PoseFormat("franka").words == "4x4 by columns, m"


@pytest.mark.parametrize(
    ("text", "reading", "message"),
    [
        ("0.1,0.2,0.3,0,180,0\n", PoseFormat("ur"), "angles up to 180 are not radians: give --deg"),
        (
            "x,y,z,rx,ry,rz\n" + "0.1,0.2,0.3,0,2,0\n" * 3 + "0.1,0.2,0.3,0,180,0\n",
            PoseFormat("ur"),
            ":5: 180 is not an angle in radians: correct line 5, or give --deg",
        ),
        (
            "100,20,30,0.1,0,0\n100,20,30,0.2,0,1\n100,20,30,-3,0,0\n",
            PoseFormat("kuka"),
            "they look like radians. Give --rad",
        ),
        ("x_mm,y,z,rx,ry,rz\n1,2,3,0,0,0\n", PoseFormat("ur"), "x_mm: the unit is mm, but another is expected"),
        (
            "x,y,z,rx_deg,ry,rz\n1,2,3,0,0,0\n",
            PoseFormat("ur"),
            "rx_deg: the unit is deg, but another is expected",
        ),
        (
            "x [rad],y,z,rx,ry,rz\n1,2,3,0,0,0\n",
            PoseFormat("ur"),
            "x [rad]: the unit is rad, expected m, mm",
        ),
        ("x,y,z,rx [m],ry,rz\n1,2,3,0,0,0\n", PoseFormat("ur"), "rx [m]: the unit is m, expected deg, "),
        (
            "x_mm,y,z,qx,qy,qz,qw\n1,2,3,0,0,0,1\n",
            PoseFormat("ros"),
            "x_mm: the unit is mm, but another is expected",
        ),
        (
            "x,y,z,qx [m],qy,qz,qw\n1,2,3,0,0,0,1\n",
            PoseFormat("ros"),
            "qx [m]: the unit is m, expected no unit",
        ),
        ("{X 1,Y 2,Z 3,A 4,B 5,C 6}\n", PoseFormat("fanuc"), ":1: 6 numbers in brackets, expected X, Y, Z, W, P, R"),
        ("X,Y,Z,A,B,C\n1,2,3,0,0,0\n", PoseFormat("ur"), "these columns suit --format kuka, doosan"),
        ("1,2,3,1,1,0,0\n", PoseFormat("abb"), "poses.txt:1: q_xyzw has norm 1.41421"),
        ("x,y,z,rx,ry,rz,sample\n1,2,3,0,0,0,1.5\n", PoseFormat("ur"), "1.5 is not a whole number from 0"),
    ],
)
def test_wrong_units_and_columns_are_reported(tmp_path: Path, text: str, reading: PoseFormat, message: str) -> None:
    """Units and columns that do not fit the format are refused, with the option to give instead."""
    with pytest.raises(DatasetError) as error:
        poses(tmp_path, text, reading)
    assert message in str(error.value)


def test_angle_unit_is_refused_for_formats_without_angles() -> None:
    """Quaternions and matrices have no unit of angles."""
    for name in ("abb", "ros", "franka", "matrix"):
        with pytest.raises(InputError, match="writes no angles"):
            _ = PoseFormat(name, None, 1.0).convention


def test_small_angles_are_accepted_in_stated_degrees(tmp_path: Path) -> None:
    """A flange that rotates little is accepted in stated degrees. One that never rotates is accepted in any case."""
    text = "100,20,30,0.1,0,0\n100,20,30,0.2,0,1\n100,20,30,-3,0,0\n"
    assert len(poses(tmp_path, text, PoseFormat("kuka", None, math.radians(1)))) == 3
    assert len(poses(tmp_path, "1,2,3,0,0,0\n4,5,6,0,0,0\n7,8,9,0,0,0\n", PoseFormat("kuka"))) == 3


def test_key_columns_identify_rows() -> None:
    """Columns `image`, `sample` and `stamp_s` assign rows, also under usual other names of image and time."""
    table = read_text_table("Filename,sample,time_s,x\na.png,4,12.5,1\n", "t.csv", ("x",))
    (row,) = keyed_rows(table)
    assert (row.image, row.sample, row.stamp_s) == ("a.png", 4, 12.5)
    (row,) = keyed_rows(read_text_table("Bildname;x\nIMG_7;1\n", "t.csv", ("x",)))
    assert (row.image, row.line) == ("IMG_7", 2)


@pytest.mark.parametrize(
    ("header", "cell"),
    [
        ("time [s],x", "12.5"),
        ("Timestamp (s),x", "12.5"),
        ("time_s,x", "12.5"),
        ("t [ms],x", "12500"),
        ("stamp_us,x", "12500000"),
        ("#timestamp [ns],x [m]", "12500000000"),
        ("time,x\nms,mm", "12500"),
        ("t_mm,time,x", "3,12.5"),
    ],
)
def test_times_have_unit_of_their_header(header: str, cell: str) -> None:
    """Before, a time column with a unit was ignored, and rows were paired in order."""
    table = read_text_table(f"{header}\n{cell},1\n", "t.csv", ("x",))
    assert [row.stamp_s for row in keyed_rows(table)] == [pytest.approx(12.5)]


def test_nanosecond_times_need_stated_unit() -> None:
    """The error for times of this year in nanoseconds refers to the unit; with it they become seconds since 1970."""
    text = "timestamp,x\n1700000000500000000,1\n"
    with pytest.raises(
        DatasetError, match=r"t.csv:2: timestamp: '1700000000500000000' is .*, or beyond 1e\+12: check its"
    ):
        keyed_rows(read_text_table(text, "t.csv", ("x",)))
    (row,) = keyed_rows(read_text_table(text.replace("stamp", "stamp_ns"), "t.csv", ("x",)))
    assert row.stamp_s == pytest.approx(1700000000.5, abs=1e-6)


def test_duplicate_key_columns_are_refused() -> None:
    """Before, the last of two equal columns was used."""
    with pytest.raises(DatasetError, match=r"t.csv: names the column 'time' twice: keep one"):
        keyed_rows(read_text_table("time,x,time\n1,2,3\n", "t.csv", ("x",)))


def test_stacked_matrices_of_real_recording() -> None:
    """Ten poses of a UR5e, as stacked 4x4 matrices, are rotations within the arm's reach."""
    file = data_folder() / "ur5e_dual_charuco_2023" / "r1_tf.txt"
    if not file.exists():
        pytest.skip(f"{file} is not there: set BASECAL_DATA to the folder of the published recordings")
    rows = read_controller_poses(str(file), "hand", PoseFormat("matrix", 1.0))
    lengths = [np.linalg.norm(row.robots["hand"].base_from_flange.translation) for row in rows]
    assert len(rows) == 10
    assert 0.2 < min(lengths) < max(lengths) < 0.95


def test_format_is_guessed_only_if_unambiguous(tmp_path: Path) -> None:
    """Matrices and ROS quaternions are unambiguous; angles are not."""
    for text, name in (("x,y,z,qx,qy,qz,qw\n", "ros"), ("m00,m01\n", "matrix")):
        (tmp_path / "a.csv").write_text(text)
        assert guessed_format(str(tmp_path / "a.csv")) == name
    assert guessed_format("a.npz:poses") == "matrix"
    unit = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
    for text in (unit, "# 6 poses\n" + unit, unit.replace("\n", " "), '{"poses": [[1, 0, 0, 0.1]]}'):
        (tmp_path / "a.txt").write_text(text)
        assert guessed_format(str(tmp_path / "a.txt")) == "matrix"
    for name, text in (
        ("a.csv", "x,y,z,rx,ry,rz\n"),
        ("a.script", "p[0.1, 0.2, 0.3, 0, 0, 1.5]\n"),
        ("a.dat", "DECL FRAME P1={X 812.3,Y -40.1,Z 655.0,A 12.4,B 3.1,C 178.2}\n"),
        ("a.mod", "CONST robtarget p10:=\n[[702.1,33.0,540.2],[0.02,0.71,0.70,0.01]];\n"),
    ):
        (tmp_path / name).write_text(text)
        assert not guessed_format(str(tmp_path / name))


@pytest.mark.parametrize(
    ("header", "what"),
    [
        ("位置X,位置Y,位置Z,a,b,c", "use these names in the header, and save the file in UTF-8"),
        ("posX1,posX2,z,a,b,c", "use these names in the header"),
    ],
)
def test_unknown_column_names_have_advice(tmp_path: Path, header: str, what: str) -> None:
    """The error ends with what to do, including the encoding if letters are not ASCII."""
    with pytest.raises(DatasetError) as caught:
        poses(tmp_path, f"{header}\n1,2,3,0,0,90\n", PoseFormat("doosan"))
    assert str(caught.value).endswith(f"doosan writes x, y, z, a, b, c: {what}")


ROS_LOG = ",".join(
    ["__time", *(f"/tcp/pose/position/{axis}" for axis in "xyz"), *(f"/tcp/pose/orientation/{axis}" for axis in "wxyz")]
)


@pytest.mark.parametrize(
    ("header", "row", "name"),
    [
        ("Pos X (m),Pos Y (m),Pos Z (m),Rot A (deg),Rot B (deg),Rot C (deg)", "1,2,3,0,0,90", "kuka"),
        ("timestamp actual_q_0 " + " ".join(f"actual_TCP_pose_{k}" for k in range(6)), "5 9 1 2 3 1.5707963 0 0", "ur"),
        (ROS_LOG, "5,1,2,3,0.5,0.5,0,0", "ros"),
        ("translation.x,translation.y,translation.z,quat x,quat w,quat y,quat z", "1,2,3,0.5,0.5,0,0", "abb"),
    ],
)
def test_column_names_of_other_programs_are_read(tmp_path: Path, header: str, row: str, name: str) -> None:
    """Columns are found by the position and rotation in their names, in any order."""
    row = row.replace("0.5,0.5", "0.70710678,0.70710678")
    read = poses(tmp_path, f"{header}\n{row}\n", PoseFormat(name, 1.0))
    np.testing.assert_allclose(read.translation, [[1, 2, 3]])
    np.testing.assert_allclose(read.rotvec, [[np.pi / 2, 0, 0]], atol=1e-6)


def test_joint_columns_are_recognised(tmp_path: Path) -> None:
    """A table of joints is refused as poses, with the command to import joints."""
    with pytest.raises(DatasetError, match="these look like joints: record poses, or use basecal import joints"):
        poses(tmp_path, "A1,A2,A3,A4,A5,A6\n1,2,3,4,5,6\n", PoseFormat("kuka"))


def test_fanuc_program_is_refused(tmp_path: Path) -> None:
    """A FANUC program has positions over several lines, which are not rows."""
    text = "/PROG  CALIB\n/POS\nP[1]{\n   GP1:\n\tX = 612.000  mm,\tY = 1.000  mm,\tZ = 2.000  mm,\n};\n/END\n"
    with pytest.raises(DatasetError, match=r"a FANUC program is not read: write its positions as a table of X, Y, Z"):
        poses(tmp_path, text, PoseFormat("fanuc"), "CALIB.LS")


@pytest.mark.parametrize(("controller", "length", "angle", "words"), [
    ("kuka", 0.4, 1.5, "metres and radians: give --length-unit m --rad, or --format ur"),
    ("ur", 400.0, 90.0, "millimetres and degrees: give --length-unit mm --deg, or --format .*kuka"),
    ("ur", 0.4, 1.5, ""), ("kuka", 400.0, 90.0, ""), ("kuka", 0.4, 90.0, ""), ("ur", 400.0, 1.5, ""),
])  # fmt: skip
def test_units_of_other_controllers_are_suggested(controller, length, angle, words):
    """Another unit is suggested if lengths and angles both fit it; one of them alone may be intended."""
    numbers = np.random.default_rng(0).uniform(-1, 1, (30, 6)) * np.repeat([length, angle], 3)
    message = _other_controllers(numbers, CONTROLLERS[controller], PoseFormat(controller))
    assert re.search(words, message) if words else message == ""
    assert _other_controllers(numbers, CONTROLLERS[controller], PoseFormat(controller, length_m=1e-3)) == ""


@pytest.mark.parametrize(("column", "unit"), [
    ("x_mm", ("mm", 1e-3)), ("Z [M]", ("m", 1.0)), ("y in inch", ("inch", 0.0254)), (" x (in) ", ("in", 0.0254)),
    ("rx_deg", None), ("x", None), ("mm", None),
])  # fmt: skip
def test_length_units_in_column_names(column, unit):
    """Column names of angles, and names without a unit, have no length unit."""
    assert column_unit(column) == unit


STACKED = "1 0 0 100\n0 1 0 200\n0 0 1 300\n0 0 0 1\n"


@pytest.mark.parametrize(("text", "length_m"), [
    (STACKED, 1e-3), (STACKED.replace("\n", " "), 1e-3), ("# one\n\n" + STACKED.replace(" ", ",") + STACKED, 1e-3),
    ("m00,m01,m02,m03,m10,m11,m12,m13,m20,m21,m22,m23\n1,0,0,100,0,1,0,200,0,0,1,300\n", 1e-3),
    (STACKED, None),
])  # fmt: skip
def test_matrix_layouts_have_length_unit(tmp_path, text, length_m):
    """Matrices are read from four lines, from one, or from named columns without the last row.

    The default unit is metres.
    """
    read = poses(tmp_path, text, PoseFormat("matrix", length_m))
    scale = length_m or 1.0
    np.testing.assert_allclose(read.translation, [[100 * scale, 200 * scale, 300 * scale]] * len(read), atol=1e-12)
    np.testing.assert_allclose(read.rotation, [np.eye(3)] * len(read), atol=1e-12)


@pytest.mark.parametrize(("name", "column"), [("matrix", 3), ("matrix", 11), ("franka", 12), ("franka", 14)])
def test_only_translation_columns_take_unit(tmp_path, name, column):
    """A unit is accepted for the last column by rows, or the last four numbers by columns, except the constant 1."""
    names = list(CONTROLLERS[name].names)
    row = ",".join("1" if k in (0, 5, 10, 15) else "0" for k in range(16))

    def read(place, unit):
        """Read the file with a unit at one name."""
        header = ",".join(f"{each} [{unit}]" if k == place else each for k, each in enumerate(names))
        return poses(tmp_path, f"{header}\n{row}\n", PoseFormat(name))

    assert len(read(column, "m")) == 1
    with pytest.raises(DatasetError, match="the unit is mm, but another is expected: give --length-unit mm"):
        read(column, "mm")
    for place in {0, 12, 14, 15} if name == "matrix" else {0, 3, 11, 15}:
        with pytest.raises(DatasetError, match="the unit is m, expected no unit"):
            read(place, "m")


def test_duplicate_pose_columns_are_refused(tmp_path):
    """Two columns of one name, or two names of one quantity, are refused with both."""
    for header in ("x,x,y,z,rx,ry,rz", "X,x [m],y,z,rx,ry,rz", "pos x,tx,y,z,rx,ry,rz"):
        with pytest.raises(DatasetError, match="names the column 'x' twice: "):
            poses(tmp_path, f"{header}\n1,1,2,3,0,0,0\n", PoseFormat("ur"))
    assert poses(tmp_path, "x,tx,y,z,rx,ry,rz\n1,9,2,3,0,0,0\n", PoseFormat("ur")).translation[0, 0] == 1


@pytest.mark.parametrize(("degrees", "is_wrong"), [([3.1, 0, 0], True), ([3.2, 0, 0], False)])
def test_degrees_below_three_are_refused(tmp_path, degrees, is_wrong):
    """Three or more poses whose angles stay below 3.1 look like radians; two poses may be close to each other."""
    rows = [f"100,20,30,{a},0,{k}" for k, a in zip((0, 0, 1), degrees, strict=True)]
    if is_wrong:
        with pytest.raises(DatasetError, match=r"the angles of 3 poses reach only 3\.1: they look like radians"):
            poses(tmp_path, "\n".join(rows), PoseFormat("kuka"))
    else:
        assert len(poses(tmp_path, "\n".join(rows), PoseFormat("kuka"))) == 3
    assert len(poses(tmp_path, "\n".join(rows[:2]), PoseFormat("kuka"))) == 2


@pytest.mark.parametrize(
    ("wrong", "message"),
    [(3, ":1: 9 is not an angle in radians: correct line 1, 2, 3, or"), (4, "angles up to 9 are not radians")],
)
def test_three_wrong_rows_of_ten_are_named(tmp_path, wrong, message):
    """If more rows are wrong, another unit is suggested."""
    text = "0.1,0.2,0.3,0,9,0\n" * wrong + "0.1,0.2,0.3,0,6.28,0\n" * (10 - wrong)
    with pytest.raises(DatasetError, match=message):
        poses(tmp_path, text, PoseFormat("ur"))


def test_stream_rows_need_times(tmp_path):
    """The time is the first column without a header, or a column of that name; a table needs no time."""
    path = tmp_path / "a.csv"
    path.write_text("12.5,1,2,3,0,0,0\n13.5,1,2,3,0,0,0\n")
    found = read_pose_rows(str(path), PoseFormat("ur"), is_stream=True)
    assert [row.stamp_s for row in found.rows] == [12.5, 13.5]
    path.write_text("x,y,z,rx,ry,rz\n1,2,3,0,0,0\n")
    assert read_pose_rows(str(path), PoseFormat("ur")).rows[0].stamp_s is None
    with pytest.raises(DatasetError, match="rows of a stream need times: add a column stamp_s"):
        read_pose_rows(str(path), PoseFormat("ur"), is_stream=True)


def test_inverted_poses_are_inverted(tmp_path):
    """Poses of the base in the flange's frame are inverted with `is_inverted`; others are unchanged."""
    path = tmp_path / "a.csv"
    path.write_text("1,2,3,0.1,0.2,0.3\n")
    plain, turned = (
        read_controller_poses(str(path), "left", PoseFormat("ur"), is_inverted=each)[0].robots["left"].base_from_flange
        for each in (False, True)
    )
    np.testing.assert_allclose((plain @ turned).matrix, np.eye(4), atol=1e-12)
    assert plain.translation.tolist() == [1, 2, 3]


@pytest.mark.parametrize(("text", "stamps"), [
    ("stamp_s,x,y,z,qx,qy,qz,qw\n4,1000,0,0,0,0,0,1\n5,1000,0,0,0,0,0,1\n", [4, 5]),
    ("x,y,z,qx,qy,qz,qw\n1000,0,0,0,0,0,1\n", None),
    ("1 0 0 1000 0 1 0 0 0 0 1 0 0 0 0 1\n", None),
])  # fmt: skip
def test_poses_of_guessed_format(tmp_path, text, stamps):
    """Poses of a guessed format are read in the given unit, with times if the file has them."""
    path = tmp_path / ("a.csv" if "," in text else "a.txt")
    path.write_text(text)
    found = read_poses(path, "mm")
    np.testing.assert_allclose(found.poses.translation, [[1, 0, 0]] * len(found.poses))
    assert (None if found.stamps_s is None else found.stamps_s.tolist()) == stamps


def test_yaskawa_job_is_recognised(tmp_path):
    """A Yaskawa job read with another format is refused with the option to give."""
    with pytest.raises(DatasetError, match="is a job of a Yaskawa, not a file of ur: give --format yaskawa"):
        poses(tmp_path, "/JOB\n//NAME A\n//POS\n///NPOS 1,0,0,0,0,0\n", PoseFormat("ur"), "a.jbi")


def test_image_column_has_only_image_names():
    """A column is the image column, whatever its name, if every cell is an image name; sample 0 is valid."""
    for last, names in (("b.png", ["a.png", "b.png"]), ("b", [None, None])):
        table = read_text_table(f"n;x\na.png;1\n{last};2\n", "t.csv", ("x",))
        assert [row.image for row in keyed_rows(table)] == names
    (row,) = keyed_rows(read_text_table("sample;x\n0;1\n", "t.csv", ("x",)))
    assert row.sample == 0
    with pytest.raises(DatasetError, match="-1 is not a whole number from 0"):
        keyed_rows(read_text_table("sample;x\n-1;1\n", "t.csv", ("x",)))


@pytest.mark.parametrize(("length", "angle", "advice"), [
    (1e-3, DEGREE, ""), (1e-3, RADIAN, ""), (1.0, DEGREE, ""), (1.0, RADIAN, "mm --deg"), (0.0254, RADIAN, "mm --deg"),
])  # fmt: skip
def test_fitting_unit_gives_no_advice(length, angle, advice):
    """Numbers in millimetres and degrees cause advice only if both are read in other units."""
    numbers = np.random.default_rng(0).uniform(-1, 1, (30, 6)) * np.repeat([400.0, 90.0], 3)
    message = _other_controllers(numbers, replace(CONTROLLERS["kuka"], length=length, angle=angle), PoseFormat("kuka"))
    assert (advice in message) if advice else message == ""


@pytest.mark.parametrize(("length", "angle", "count", "is_told"), [
    (20.1, 90.0, 3, True), (19.9, 90.0, 3, False), (400.0, 6.2, 3, False), (400.0, 6.4, 3, True),
    (400.0, 90.0, 2, False),
])  # fmt: skip
def test_other_units_are_recognised_by_largest_values(length, angle, count, is_told):
    """Advice needs lengths beyond 20, angles beyond a full turn, and at least three poses."""
    numbers = np.zeros((count, 6))
    numbers[0, 1], numbers[1, 4] = -length, -angle
    assert bool(_other_controllers(numbers, CONTROLLERS["ur"], PoseFormat("ur"))) == is_told


def test_varying_angles_below_one_look_like_radians(tmp_path):
    """Equal angles are an arm that does not rotate, so only varying ones are refused."""
    for angles, is_wrong in (((0.1, 0.2, 0.3), True), ((0.2, 0.2, 0.2), False)):
        text = "\n".join(f"100,20,{k},0,0,{angle}" for k, angle in enumerate(angles))
        if is_wrong:
            with pytest.raises(DatasetError, match=r"reach only 0\.3: they look like radians"):
                poses(tmp_path, text, PoseFormat("kuka"))
        else:
            assert len(poses(tmp_path, text, PoseFormat("kuka"))) == 3


@pytest.mark.parametrize("axis", range(3))
def test_other_units_are_recognised_on_any_axis(axis):
    """The largest length and the largest angle may be on any axis."""
    numbers = np.zeros((3, 6))
    numbers[0, axis], numbers[1, 3 + axis] = 400.0, 90.0
    assert "mm --deg" in _other_controllers(numbers, CONTROLLERS["ur"], PoseFormat("ur"))


@pytest.mark.parametrize(("robot", "x"), [(None, [1, 2, 3]), ("b", [2, 3])])
def test_rows_of_one_robot_are_selected(tmp_path, robot, x):
    """All rows are read if no robot is named."""
    path = tmp_path / "a.csv"
    path.write_text("robot,x,y,z,rx,ry,rz\na,1,0,0,0,0,0\nb,2,0,0,0,0,0\nb,3,0,0,0,0,0\n")
    assert read_pose_rows(str(path), PoseFormat("ur"), robot=robot).poses.translation[:, 0].tolist() == x
