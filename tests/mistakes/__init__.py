"""Common user mistakes, applied to correct cells."""
