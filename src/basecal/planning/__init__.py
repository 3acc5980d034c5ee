"""Planning of samples for a calibration: programmed shifts, and poses about the target."""
