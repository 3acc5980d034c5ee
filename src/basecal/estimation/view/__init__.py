"""Measurements of `camera_from_target` by one view."""
