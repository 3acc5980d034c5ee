"""Sigmas of what states none."""
