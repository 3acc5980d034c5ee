"""Estimation of unstated noise."""
