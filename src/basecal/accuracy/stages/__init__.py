"""Stages of a calibration: functions that return a case with further results."""
