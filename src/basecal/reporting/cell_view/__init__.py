"""Views of the cell, in three dimensions and as a still image."""
