"""Measurements of `camera_from_target` in single views."""
