"""Observability of the unknowns: directions that the data determine."""
