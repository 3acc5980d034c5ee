"""Offsets of clocks: estimated beside all else, since robots that move stand elsewhere a moment later."""
