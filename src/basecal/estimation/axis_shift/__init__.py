"""The axis-shift method of the paper, in closed form."""
