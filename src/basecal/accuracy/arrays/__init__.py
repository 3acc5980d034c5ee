"""Calibrations of arrays under OpenCV's names."""
