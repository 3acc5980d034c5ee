"""How well a solution fits: pixels, loops, points."""
