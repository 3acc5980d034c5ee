"""Start values of all unknowns, without an initial guess."""
