"""Geometry of printed targets, and rendered images of them."""
