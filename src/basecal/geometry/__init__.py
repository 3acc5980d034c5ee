"""Rigid transforms, pose estimates with covariance, and cameras."""

from basecal.geometry.array import Array, BoolArray, IntArray, Rows, read_only, read_only_ids
from basecal.geometry.camera import Camera
from basecal.geometry.pose_estimate import PoseEstimate
from basecal.geometry.se3 import SE3

__all__ = ["SE3", "Array", "BoolArray", "Camera", "IntArray", "PoseEstimate", "Rows", "read_only", "read_only_ids"]
