"""Measurements of a driver's promises."""
