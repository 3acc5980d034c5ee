"""Solvers of a study, a file for each."""
