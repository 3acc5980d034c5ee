"""Surroundings of a target, drawn by MuJoCo: arms, table, clutter, and what they hide."""
