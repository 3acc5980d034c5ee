"""Cells of many robots: what is asked of each by the pairs that it takes part in."""
