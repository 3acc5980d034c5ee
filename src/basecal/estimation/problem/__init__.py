"""A cell and a recording as arrays, with the unknowns and their columns."""
