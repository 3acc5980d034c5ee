"""The one numerical core: derivatives, normal equations, Schur complement, Levenberg-Marquardt."""
