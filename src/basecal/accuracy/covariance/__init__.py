"""Covariance beyond linear theory: coverage of an alternative solution, and second-order curvature."""
