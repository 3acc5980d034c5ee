"""Estimation of all unknowns of a cell: initial guesses, maximum likelihood, covariance."""
