"""Figures of how a calibration fits, a file for each."""
