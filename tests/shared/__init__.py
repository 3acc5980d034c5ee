"""Cells, recordings and trials that tests and benchmarks share."""
