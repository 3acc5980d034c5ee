"""Errors that are no noise: lengths, clocks, steps, drifts and sag, found by score tests and confirmed by blocks."""
