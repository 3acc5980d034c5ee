"""Calibrations told to people; nothing is computed here."""
