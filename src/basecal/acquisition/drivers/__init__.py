"""Drivers: a file and a line in the registry for each; each has `open_robot`, `open_camera`, or both."""
