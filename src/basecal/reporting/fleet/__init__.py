"""A folder of calibrated cells as text and as a page."""
