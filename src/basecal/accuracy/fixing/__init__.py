"""Fixes that a diagnosis named, applied to the files of a cell."""
