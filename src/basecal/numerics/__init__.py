"""Numerical methods independent of robots: batches of dataclasses, Levenberg-Marquardt, rank and pseudo-inverse."""
