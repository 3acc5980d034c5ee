"""Systematic errors (lengths, clocks, steps, drifts, sag), found by score tests and confirmed by held-out blocks."""
