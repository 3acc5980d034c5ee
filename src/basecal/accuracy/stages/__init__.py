"""The stages of a calibration: functions from a case to the same case with more known of it."""
