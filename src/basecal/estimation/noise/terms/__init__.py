"""Errors of poses that a robot's stops have in common: a file and a line for each, see `term`."""
