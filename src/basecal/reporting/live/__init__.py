"""A capture while it goes on: in the terminal, and as a local page."""
