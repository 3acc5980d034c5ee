"""Connections to controllers that are re-established after a loss."""
