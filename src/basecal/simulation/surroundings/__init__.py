"""What stands around a target, drawn by MuJoCo: arms, table, clutter, and what they hide."""
