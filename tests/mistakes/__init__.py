"""Mistakes that people make, done to cells in order."""
