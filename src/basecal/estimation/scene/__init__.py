"""Calibrate cameras and bases from images of a static scene with unknown points."""
