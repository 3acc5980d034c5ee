"""Live views of a running capture: in the terminal, and as a local page."""
