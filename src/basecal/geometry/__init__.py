"""Rigid transforms, estimates of them, and cameras."""

from basecal.geometry.array import Array, IntArray, read_only, read_only_ids
from basecal.geometry.camera import Camera
from basecal.geometry.pose_estimate import PoseEstimate
from basecal.geometry.se3 import SE3

__all__ = ["SE3", "Array", "Camera", "IntArray", "PoseEstimate", "read_only", "read_only_ids"]
