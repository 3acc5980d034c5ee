"""Calibrations from arrays, with OpenCV's names."""
