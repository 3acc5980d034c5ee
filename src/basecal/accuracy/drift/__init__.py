"""Whether a cell is still as it was calibrated: new samples against what the calibration predicts of them."""
