"""Numerical core of all solvers: derivatives, normal equations, Schur complement, Levenberg-Marquardt."""
