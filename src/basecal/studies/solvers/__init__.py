"""Solvers of a study, one module each."""
