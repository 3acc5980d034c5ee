"""Deviations from what is stated: a file and a registry line for each effect, see `effect`."""
