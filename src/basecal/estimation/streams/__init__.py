"""Robots and cameras recorded each by its own clock: robots' paths, read at the instants of the views."""
