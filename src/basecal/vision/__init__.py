"""Targets in images: how they look, and where they are found. The only package that loads OpenCV."""
