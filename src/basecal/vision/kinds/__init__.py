"""Detectors for each kind of target."""
