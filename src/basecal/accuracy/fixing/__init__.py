"""Fixes of findings, applied to the files of a cell."""
