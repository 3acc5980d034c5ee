"""Kinematics of serial arms: forward kinematics, derivatives, and inverse kinematics."""

from basecal.kinematics.chain import ChainPosture, Masses, SerialChain
from basecal.kinematics.gravity import gravity_torques
from basecal.kinematics.inverse import inverse
from basecal.kinematics.urdf import parse_chain, path_joint_names, read_chain

__all__ = [
    "ChainPosture",
    "Masses",
    "SerialChain",
    "gravity_torques",
    "inverse",
    "parse_chain",
    "path_joint_names",
    "read_chain",
]
