"""How a target of each kind is found in an image."""
