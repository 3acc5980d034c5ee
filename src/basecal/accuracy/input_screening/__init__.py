"""Checks of a recording before anything is solved."""
