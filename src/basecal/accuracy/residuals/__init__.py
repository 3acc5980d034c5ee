"""Residuals of a solution: pixels, loops and points."""
