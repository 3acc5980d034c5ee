"""A cell and a recording as arrays, and the unknowns with their columns."""
