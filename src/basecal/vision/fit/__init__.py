"""Shapes fitted to pieces of an image."""
