"""Calibration from the static scene that cameras see, without a target."""
