"""Interpretations of a cell and its recording, and transformations between them."""
