"""Pose conventions of robots' controllers, with one entry per controller in `registry`."""
