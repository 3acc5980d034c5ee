"""How robots' controllers write poses, a module each with its `CONVENTION`; a new one is a line in the registry too."""
