"""Output of planned robot motions in the formats of other programs."""
