"""A plan of samples as text and as a page."""
