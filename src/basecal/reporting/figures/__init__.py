"""Figures of the residuals and of the coverage of a calibration."""
