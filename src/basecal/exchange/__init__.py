"""Conventions of other programs, each translated once."""
