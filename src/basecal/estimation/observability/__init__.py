"""Which directions of the unknowns the data determine."""
