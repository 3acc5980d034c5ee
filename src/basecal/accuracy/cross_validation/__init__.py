"""Samples predicted that were not used."""
