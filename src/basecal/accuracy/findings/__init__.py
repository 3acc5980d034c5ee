"""Findings about an answer: one file for each kind, registered in `registry`."""
