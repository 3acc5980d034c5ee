"""Numerical ideas that know nothing of robots: batches of nouns, Levenberg-Marquardt, rank and pseudo-inverse."""
