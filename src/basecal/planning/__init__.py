"""Where arms should go so that a calibration follows: programmed shifts, and poses all around."""
