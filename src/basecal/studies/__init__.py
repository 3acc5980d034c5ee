"""Simulation studies: reproduction of published results, and parameter sweeps."""
