"""Surroundings of a target, rendered with MuJoCo: arms, table, clutter, and their occlusions."""
