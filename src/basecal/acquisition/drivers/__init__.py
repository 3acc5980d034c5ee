"""Drivers: each is a module with `open_robot`, `open_camera`, or both, and an entry in the registry."""
