"""Verification of a calibrated cell: comparison of new samples with their predictions by the calibration."""
