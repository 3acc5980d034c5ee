"""Serial arms: where the flange is, its derivatives, and the way back."""

from basecal.kinematics.chain import SerialChain
from basecal.kinematics.inverse import inverse
from basecal.kinematics.urdf import parse_chain, read_chain, way_names

__all__ = ["SerialChain", "inverse", "parse_chain", "read_chain", "way_names"]
