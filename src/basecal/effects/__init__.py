"""Deviations of a cell from its statement: a module and a registry entry for each effect, see `faces.effect`."""
