"""Calibrations for people to read; nothing is computed here."""
