"""Studies that reproduce published figures and sweep what they depend on."""
