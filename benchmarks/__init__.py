"""Benchmarks: what basecal claims, measured. See README.md."""
