"""Clock offsets, estimated jointly with the calibration: moving robots have other poses a moment later."""
